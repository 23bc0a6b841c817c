// The patch coordinates of a tile's pixels, and other polynomials over a tile, for AVX-512. Internal to
// blend_avx512.cpp, which includes it inside NODAL_TARGET_BEGIN.
#pragma once

#include <immintrin.h>

#include <array>
#include <cstdint>

#include "stitch/blend/blend_job.h"
#include "stitch/blend/constants_avx512.h"
#include "stitch/blend/patch_avx512.h"

namespace nodal::blend {
namespace {

/// Two registers of 32 numbers: the upper four rows of a tile, and its lower four. A 128-bit lane is a row.
struct Rows {
  V upper;
  V lower;
};

constexpr Constants kConstants = constants();

[[gnu::always_inline]] inline V load(const Constants::Shorts& numbers) { return _mm512_load_si512(numbers.data()); }
template <class Number>
[[gnu::always_inline]] inline __m256i load_half(const std::array<Number, 32 / sizeof(Number)>& numbers) {
  return _mm256_load_si256(reinterpret_cast<const __m256i*>(numbers.data()));
}
/// One number in every lane of a register.
[[gnu::always_inline]] inline V all(const RepeatedInt16& number) { return _mm512_set1_epi32(number.both()); }

/// The patch coordinates of half a tile's pixels, in the form that interpolation needs.
struct Places {
  V index;   ///< byte pairs: row * 16 + column of the upper left sample, and of its right neighbour
  V across;  ///< byte pairs: the shares of the left and the right sample, in -1/128, because -128 fits a byte
  V down;    ///< the lower row's share, in 1/2^15
};

/// For each 16-bit number, the eight bits that start at a given bit, in both of its bytes.
[[gnu::always_inline]] inline V twice_from(const Constants::Bytes& bit, V numbers) {
  return _mm512_multishift_epi64_epi8(load(bit), numbers);
}

[[gnu::always_inline]] inline V index_of(const Constants& k, V x, V y) {
  const V rows = _mm512_shuffle_epi8(y, load(k.tops));
  const V both = _mm512_ternarylogic_epi32(rows, twice_from(k.nibble, x), load(k.upper_nibbles), 0xe4);  // c ? a : b
  return _mm512_add_epi8(both, load(k.pair_of));
}
[[gnu::always_inline]] inline V across_of(const Constants& k, V x) {  // f - 128 and -f, see Places::across
  // (a & b) ^ c.
  const V flipped = _mm512_ternarylogic_epi32(twice_from(k.seven, x), load(k.low_bits), load(k.flips), 0x6a);
  return _mm512_add_epi8(flipped, load(k.across));
}
[[gnu::always_inline]] inline V down_of(const Constants& k, V y) {
  return _mm512_and_si512(_mm512_slli_epi16(y, 3), load(k.share));
}

[[gnu::always_inline]] inline Places places(const Constants& k, V x, V y) {
  return {index_of(k, x, y), across_of(k, x), down_of(k, y)};
}

/// The lower (or upper) 128 bits, repeated in all four lanes.
[[gnu::always_inline]] inline V lower_half(__m256i v) { return _mm512_broadcast_i32x4(_mm256_castsi256_si128(v)); }
[[gnu::always_inline]] inline V upper_half(__m256i v) {
  const V wide = _mm512_castsi256_si512(v);
  return _mm512_shuffle_i64x2(wide, wide, 0x55);
}

/// The patch coordinates of a tile's pixels.
struct Coordinates {
  Rows x;
  Rows y;
};

[[gnu::always_inline]] inline Coordinates coordinates_of(const Constants& k, const GridTable& grid,
                                                         const PatchRecord& record) {
  if (record.listed()) {
    const std::uint16_t* list = grid.coordinates.data() + record.list() * 2 * kTilePixels;
    return {{_mm512_loadu_si512(list), _mm512_loadu_si512(list + 32)},
            {_mm512_loadu_si512(list + 64), _mm512_loadu_si512(list + 96)}};
  }
  const __m256i both = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(&record));  // x in the low half, y above it
  const auto term = [&](std::size_t t) { return _mm256_shuffle_epi8(both, load_half(k.term[t])); };
  const __m256i a = _mm256_add_epi16(_mm256_add_epi16(term(0), _mm256_mullo_epi16(term(1), load_half(k.i))),
                                     _mm256_mullo_epi16(term(4), load_half(k.ii)));
  const __m256i b = _mm256_add_epi16(term(2), _mm256_mullo_epi16(term(3), load_half(k.i)));
  const __m256i c = term(5);
  const auto rows = [&](V a_, V b_, V c_) -> Rows {
    const V upper =
        _mm512_add_epi16(_mm512_add_epi16(a_, _mm512_mullo_epi16(b_, load(k.j))), _mm512_mullo_epi16(c_, load(k.jj)));
    const V four_rows = _mm512_add_epi16(_mm512_slli_epi16(b_, 2), _mm512_mullo_epi16(c_, load(k.next)));
    return {upper, _mm512_add_epi16(upper, four_rows)};
  };
  return {rows(lower_half(a), lower_half(b), lower_half(c)), rows(upper_half(a), upper_half(b), upper_half(c))};
}

/// A bilinear polynomial over a tile: coefficients of 1, i, j, ij.
[[gnu::always_inline]] inline Rows bilinear(const Constants& k, const std::int16_t* q) {
  const __m256i terms = _mm256_broadcastq_epi64(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(q)));
  const auto halves = [&](std::size_t t) { return _mm256_shuffle_epi8(terms, load_half(k.pair[t])); };
  const __m256i both = _mm256_add_epi16(halves(0), _mm256_mullo_epi16(halves(1), load_half(k.i)));
  const V b = upper_half(both);
  const V upper = _mm512_add_epi16(lower_half(both), _mm512_mullo_epi16(b, load(k.j)));
  return {upper, _mm512_add_epi16(upper, _mm512_slli_epi16(b, 2))};
}

}  // namespace
}  // namespace nodal::blend
