// Writes rows of a raymap past the caches. Internal to blend_avx512.cpp, which includes it inside NODAL_TARGET_BEGIN.
#pragma once

#include <immintrin.h>

#include <array>
#include <cstdint>

#include "stitch/blend/patch_avx512.h"
#include "stitch/blend/tile_driver.h"

namespace nodal::blend {
namespace {

constexpr std::array<std::uint8_t, 64> counted() {
  std::array<std::uint8_t, 64> numbers{};
  for (std::size_t k = 0; k < 64; ++k) numbers[k] = static_cast<std::uint8_t>(k);
  return numbers;
}
alignas(64) constexpr std::array<std::uint8_t, 64> kCounted = counted();

/// Bypasses the caches if `to` is aligned, because the store then fills a whole cache line.
[[gnu::always_inline]] inline void put_bytes(std::uint8_t* to, V bytes) {
  if ((reinterpret_cast<std::uintptr_t>(to) & 63) == 0) {
    _mm512_stream_si512(reinterpret_cast<V*>(to), bytes);
  } else {
    _mm512_storeu_si512(to, bytes);
  }
}

/// Writes N registers side by side, a strip's part of row `row` of plane `plane`. Where they begin within a cache line,
/// that line is completed with the end of the strip to the left, so that whole lines bypass the caches: a store into a
/// part of a line would read the line first.
template <std::size_t N>
[[gnu::always_inline]] inline void put_row(std::uint8_t* to, const V (&bytes)[N], const RowEnds& ends,
                                           std::size_t row) {
  const unsigned off = static_cast<unsigned>(reinterpret_cast<std::uintptr_t>(to) & 63);
  if (off == 0) {
    for (std::size_t k = 0; k < N; ++k) _mm512_stream_si512(reinterpret_cast<V*>(to + 64 * k), bytes[k]);
    return;
  }
  const V picks = _mm512_add_epi8(_mm512_load_si512(kCounted.data()), _mm512_set1_epi8(static_cast<char>(64 - off)));
  std::uint8_t* const end = ends.of + 64 * row;
  V before = _mm512_load_si512(end);
  for (std::size_t k = 0; k < N; ++k) {
    if (k == 0 && ends.leftmost) {
      _mm512_mask_storeu_epi8(to, ~std::uint64_t{0} >> off, bytes[0]);
    } else {
      _mm512_stream_si512(reinterpret_cast<V*>(to - off + 64 * k), _mm512_permutex2var_epi8(before, picks, bytes[k]));
    }
    before = bytes[k];
  }
  if (ends.rightmost) {
    _mm512_mask_storeu_epi8(to - off + 64 * N, ~std::uint64_t{0} >> (64 - off),
                            _mm512_permutex2var_epi8(before, picks, before));
  } else {
    _mm512_store_si512(end, before);
  }
}

}  // namespace
}  // namespace nodal::blend
