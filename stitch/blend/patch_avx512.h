// Loads patches of 16x16 samples into four AVX-512 registers, for every SampleLayout. Internal to blend_avx512.cpp,
// which includes it inside NODAL_TARGET_BEGIN.
#pragma once

#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <type_traits>

#include "stitch/blend/blend_job.h"

namespace nodal::blend {
namespace {

using V = __m512i;

/// One component of a patch: rows 0 .. 3, 4 .. 7, and so on.
struct Patch {
  V rows[4];
};

/// Four rows of 16 bytes, `stride` apart. A load that repeats 16 bytes over 32 needs no shuffle; over 64 it does.
[[gnu::always_inline]] inline V four_rows(const std::uint8_t* at, std::ptrdiff_t stride) {
  const auto row = [&](int k) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(at + k * stride)); };
  const auto two = [&](int k) {
    return _mm256_blend_epi32(_mm256_castsi128_si256(row(k)), _mm256_broadcastsi128_si256(row(k + 1)), 0xf0);
  };
  return _mm512_inserti64x4(_mm512_castsi256_si512(two(0)), two(2), 1);
}

/// Two rows of 32 bytes.
[[gnu::always_inline]] inline V two_rows(const std::uint8_t* at, std::ptrdiff_t stride) {
  const V v = _mm512_castsi256_si512(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(at)));
  return _mm512_inserti64x4(v, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at + stride)), 1);
}

/// Byte indices into two registers, which pick component `first` of groups of `step` bytes: first, first + step, ..
struct Picks {
  alignas(64) std::array<std::array<std::uint8_t, 64>, 3> of{};
};
constexpr Picks pair_picks() {  // 16 samples from each of four rows of 32 bytes; by offset
  Picks picks;
  for (std::size_t k = 0; k < 64; ++k) {
    for (std::size_t c = 0; c < 2; ++c) picks.of[c][k] = static_cast<std::uint8_t>(2 * k + c);
  }
  return picks;
}
constexpr Picks quad_picks() {  // 16 samples from each of two rows of 64 bytes, for components c, c + 2
  Picks picks;
  for (std::size_t k = 0; k < 64; ++k) {
    for (std::size_t c = 0; c < 2; ++c) {
      picks.of[c][k] = static_cast<std::uint8_t>(k / 16 % 2 * 64 + k % 16 * 4 + c + k / 32 * 2);
    }
  }
  return picks;
}
constexpr Picks triple_picks() {  // 16 samples from each of two rows of 48 bytes: components 0 and 1; 2 twice
  Picks picks;
  for (std::size_t k = 0; k < 64; ++k) {
    const std::size_t from = k / 16 % 2 * 64 + k % 16 * 3;
    picks.of[0][k] = static_cast<std::uint8_t>(from + k / 32);
    picks.of[1][k] = static_cast<std::uint8_t>(from + 2);
  }
  return picks;
}
constexpr Picks kPairPicks = pair_picks();
constexpr Picks kQuadPicks = quad_picks();
constexpr Picks kTriplePicks = triple_picks();

[[gnu::always_inline]] inline V load(const std::array<std::uint8_t, 64>& bytes) {
  return _mm512_load_si512(bytes.data());
}

/// A patch in memory, one component after another.
template <int N>
using Staged = std::array<std::uint8_t, N * kPatch * kPatch>;

/// Copies a patch of any layout to memory, sample by sample.
[[gnu::noinline]] void stage(const PatchPlane& plane, const PatchRecord& record, std::size_t components,
                             std::uint8_t* staged) {
  std::fill_n(staged, components * kPatch * kPatch, std::uint8_t{0});
  for (std::size_t c = 0; c < components; ++c, staged += kPatch * kPatch) {
    const PlaneView& view = plane.views[c];
    for (int y = 0; y < std::min(kPatch, view.height - record.top); ++y) {
      const std::uint8_t* from = view.data + (record.top + y) * view.row_stride;
      for (int x = 0; x < std::min(kPatch, view.width - record.left); ++x) {
        staged[y * kPatch + x] = from[std::ptrdiff_t{record.left + x} * view.pixel_stride];
      }
    }
  }
}

/// Loads rows[k] of all components' patches, `down` bytes after the patch's start. Groups are loaded from from[0].
template <int N, SampleLayout kLayout>
[[gnu::always_inline]] inline void load_rows(const PatchPlane& plane, const std::array<const std::uint8_t*, N>& from,
                                             std::ptrdiff_t stride, std::ptrdiff_t down, std::size_t k,
                                             std::array<Patch, N>& patch) {
  const auto row = [&](int y) { return _mm512_loadu_si512(from[0] + down + y * stride); };
  if constexpr (kLayout == SampleLayout::kPairs) {
    const V upper = two_rows(from[0] + down, stride);
    const V lower = two_rows(from[0] + down + 2 * stride, stride);
    for (std::size_t c = 0; c < N; ++c) {
      patch[c].rows[k] = _mm512_permutex2var_epi8(upper, load(kPairPicks.of[plane.offset[c] & 1]), lower);
    }
  } else if constexpr (kLayout == SampleLayout::kQuads) {
    const V picks = load(kQuadPicks.of[plane.offset[0] & 1]);
    const V upper = _mm512_permutex2var_epi8(row(0), picks, row(1));
    const V lower = _mm512_permutex2var_epi8(row(2), picks, row(3));
    patch[0].rows[k] = _mm512_shuffle_i64x2(upper, lower, 0x44);
    patch[1].rows[k] = _mm512_shuffle_i64x2(upper, lower, 0xee);
  } else if constexpr (kLayout == SampleLayout::kTriples) {
    const auto triples = [&](int y) {
      return _mm512_maskz_loadu_epi8(0x0000ffffffffffff, from[0] + down + y * stride);
    };
    const V rows[4] = {triples(0), triples(1), triples(2), triples(3)};
    const V both = load(kTriplePicks.of[0]);
    const V last = load(kTriplePicks.of[1]);
    const V upper = _mm512_permutex2var_epi8(rows[0], both, rows[1]);
    const V lower = _mm512_permutex2var_epi8(rows[2], both, rows[3]);
    patch[0].rows[k] = _mm512_shuffle_i64x2(upper, lower, 0x44);
    patch[1].rows[k] = _mm512_shuffle_i64x2(upper, lower, 0xee);
    patch[2].rows[k] = _mm512_shuffle_i64x2(_mm512_permutex2var_epi8(rows[0], last, rows[1]),
                                            _mm512_permutex2var_epi8(rows[2], last, rows[3]), 0x44);
  } else {
    for (std::size_t c = 0; c < N; ++c) patch[c].rows[k] = four_rows(from[c] + down, stride);
  }
}

template <int N, SampleLayout kLayout>
[[gnu::always_inline]] inline void load_patch(const PatchPlane& plane, const PatchRecord& record,
                                              std::array<Patch, N>& patch) {
  std::ptrdiff_t stride = plane.row_stride;
  std::array<const std::uint8_t*, N> from;
  Staged<kLayout == SampleLayout::kGeneral ? N : 0> staged;
  if constexpr (kLayout == SampleLayout::kGeneral) {
    stage(plane, record, N, staged.data());
    stride = kPatch;
    for (std::size_t c = 0; c < N; ++c) from[c] = staged.data() + c * kPatch * kPatch;
  } else {
    const std::ptrdiff_t at = record.top * stride + std::ptrdiff_t{record.left} * plane.group;
    for (std::size_t c = 0; c < (kLayout == SampleLayout::kPlanar ? N : 1); ++c) from[c] = plane.data[c] + at;
  }
  for (std::size_t k = 0; k < 4; ++k) {
    // A tile seldom needs the last four rows of a patch, and then they have not been prefetched. Rows 8 .. 11 are
    // loaded again in that case: reading rows that are in the cache is cheaper than a branch that mispredicts.
    const int row = k == 3 ? 8 + (record.last_row() + 5) / 16 * 4 : static_cast<int>(4 * k);
    load_rows<N, kLayout>(plane, from, stride, row * stride, k, patch);
  }
}

/// Calls use(std::integral_constant<SampleLayout, layout>): that code is compiled once per layout, so that patches stay
/// in registers.
template <int N, class Use>
[[gnu::always_inline]] inline void by_layout(SampleLayout layout, Use use) {
  if (layout == SampleLayout::kPlanar) return use(std::integral_constant<SampleLayout, SampleLayout::kPlanar>());
  if constexpr (N < 3) {
    if (layout == SampleLayout::kPairs) return use(std::integral_constant<SampleLayout, SampleLayout::kPairs>());
  }
  if constexpr (N == 2) {
    if (layout == SampleLayout::kQuads) return use(std::integral_constant<SampleLayout, SampleLayout::kQuads>());
  }
  if constexpr (N == 3) {
    if (layout == SampleLayout::kTriples) return use(std::integral_constant<SampleLayout, SampleLayout::kTriples>());
  }
  use(std::integral_constant<SampleLayout, SampleLayout::kGeneral>());
}

}  // namespace
}  // namespace nodal::blend
