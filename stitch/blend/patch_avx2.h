// Loads patches for AVX2, row by row; samples that are not contiguous are first packed into contiguous rows. Internal
// to blend_avx2.cpp, which includes it inside NODAL_TARGET_BEGIN.
#pragma once

#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cstdint>

#include "stitch/blend/blend_job.h"

namespace nodal::blend {
namespace {

using V = __m256i;

inline V all(int value) { return _mm256_set1_epi16(static_cast<short>(value)); }
inline V all(const RepeatedInt16& value) { return _mm256_set1_epi32(value.both()); }
inline V add(V a, V b) { return _mm256_add_epi16(a, b); }
inline V mul(V a, V b) { return _mm256_mullo_epi16(a, b); }
inline V row(const std::uint8_t* at) {
  return _mm256_broadcastsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(at)));
}
inline V load(const void* at) { return _mm256_loadu_si256(static_cast<const V*>(at)); }

/// A patch: its first row, and the distance between its rows in bytes.
struct Patch {
  const std::uint8_t* data = nullptr;
  std::ptrdiff_t stride = 0;
};
using Staged = std::array<std::uint8_t, kPatch * kPatch>;

struct Picks {
  alignas(16) std::array<std::uint8_t, 16> of;
};
inline __m128i shuffled(__m128i bytes, const Picks& picks) {
  return _mm_shuffle_epi8(bytes, _mm_load_si128(reinterpret_cast<const __m128i*>(picks.of.data())));
}
/// Shuffles that interleave 16 pixels as R G B R G B ..: [16 output bytes][component].
constexpr auto triple_picks() {
  std::array<std::array<Picks, 3>, 3> picks{};
  for (std::size_t m = 0; m < 48; ++m) {
    for (std::size_t c = 0; c < 3; ++c) {
      picks[m / 16][c].of[m % 16] = m % 3 == c ? static_cast<std::uint8_t>(m / 3) : std::uint8_t{0x80};
    }
  }
  return picks;
}
constexpr auto kTriplePicks = triple_picks();
/// 32 pixels as R G B R G B ..: the first, the second and the last third of the bytes.
inline void interleave(const V of[3], V thirds[3]) {
  V parts[3];  // 16 bytes of the left and of the right 16 pixels
  for (std::size_t k = 0; k < 3; ++k) {
    parts[k] = _mm256_setzero_si256();
    for (std::size_t c = 0; c < 3; ++c) {
      parts[k] = _mm256_or_si256(parts[k], _mm256_shuffle_epi8(of[c], row(kTriplePicks[k][c].of.data())));
    }
  }
  thirds[0] = _mm256_permute2x128_si256(parts[0], parts[1], 0x20);
  thirds[1] = _mm256_permute2x128_si256(parts[2], parts[0], 0x30);
  thirds[2] = _mm256_permute2x128_si256(parts[1], parts[2], 0x31);
}
/// The inverse: shuffles that extract 16 samples of a component: [component][16 input bytes].
constexpr auto component_picks() {
  std::array<std::array<Picks, 3>, 3> picks{};
  for (std::size_t m = 0; m < 48; ++m) {
    for (std::size_t part = 0; part < 3; ++part) {
      picks[m % 3][part].of[m / 3] = m / 16 == part ? static_cast<std::uint8_t>(m % 16) : std::uint8_t{0x80};
    }
  }
  return picks;
}
constexpr auto kComponentPicks = component_picks();

/// Copies a component's samples to contiguous rows.
inline void stage(const PatchPlane& plane, const PatchRecord& record, std::size_t c, int rows, Staged& staged) {
  const PlaneView& view = plane.views[c];
  const int height = std::min(rows, view.height - record.top);
  const int width = std::min(kPatch, view.width - record.left);
  const std::uint8_t* from = view.data + record.top * view.row_stride + std::ptrdiff_t{record.left} * view.pixel_stride;
  const V even = all(0xff);
  for (int y = 0; y < height; ++y, from += view.row_stride) {
    std::uint8_t* to = staged.data() + y * kPatch;
    if (plane.layout == SampleLayout::kPairs) {
      const V both = load(from - plane.offset[c]);
      const V mine = plane.offset[c] == 0 ? _mm256_and_si256(both, even) : _mm256_srli_epi16(both, 8);
      const V packed = _mm256_permute4x64_epi64(_mm256_packus_epi16(mine, mine), 0x08);
      _mm_store_si128(reinterpret_cast<__m128i*>(to), _mm256_castsi256_si128(packed));
    } else if (plane.layout == SampleLayout::kQuads) {
      const std::uint8_t* group = from - plane.offset[c];
      const V shift = _mm256_set1_epi32(8 * plane.offset[c]);
      const V byte = _mm256_set1_epi32(0xff);
      const V a = _mm256_and_si256(_mm256_srlv_epi32(load(group), shift), byte);
      const V b = _mm256_and_si256(_mm256_srlv_epi32(load(group + 32), shift), byte);
      const V words = _mm256_packus_epi32(a, b);  // a0-3 b0-3 a4-7 b4-7
      const V bytes = _mm256_packus_epi16(words, words);
      const V order = _mm256_setr_epi32(0, 4, 1, 5, 0, 4, 1, 5);
      _mm_store_si128(reinterpret_cast<__m128i*>(to),
                      _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(bytes, order)));
    } else if (plane.layout == SampleLayout::kTriples) {
      const auto* group = reinterpret_cast<const __m128i*>(from - plane.offset[c]);
      __m128i bytes = _mm_setzero_si128();
      for (std::size_t part = 0; part < 3; ++part) {
        bytes = _mm_or_si128(bytes, shuffled(_mm_loadu_si128(group + part), kComponentPicks[plane.offset[c]][part]));
      }
      _mm_store_si128(reinterpret_cast<__m128i*>(to), bytes);
    } else {
      for (int x = 0; x < width; ++x) to[x] = from[std::ptrdiff_t{x} * view.pixel_stride];
    }
  }
}

template <int N>
inline void find_patch(const PatchPlane& plane, const PatchRecord& record, std::array<Staged, N>& staged,
                       std::array<Patch, N>& patch) {
  const int rows = record.last_row() + 2;
  for (std::size_t c = 0; c < N; ++c) {
    if (plane.layout == SampleLayout::kPlanar) {
      patch[c] = {plane.data[c] + record.top * plane.row_stride + record.left, plane.row_stride};
    } else {
      if (plane.layout == SampleLayout::kGeneral) staged[c].fill(0);
      stage(plane, record, c, rows, staged[c]);
      patch[c] = {staged[c].data(), kPatch};
    }
  }
}

}  // namespace
}  // namespace nodal::blend
