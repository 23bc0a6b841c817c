// The patch coordinates of half a tile's pixels, and other polynomials over a tile, for AVX2. Two rows are computed at
// a time; the next two follow by adding differences. Internal to blend_avx2.cpp, which includes it inside
// NODAL_TARGET_BEGIN.
#pragma once

#include <immintrin.h>

#include <array>
#include <cstdint>
#include <cstring>

#include "stitch/blend/blend_job.h"
#include "stitch/blend/patch_avx2.h"

namespace nodal::blend {
namespace {

/// Kept in memory on purpose: otherwise the compiler rebuilds each constant at every use from one number, with three
/// instructions. As a memory operand of an instruction a constant costs nothing.
struct Constants {
  using Shorts = std::array<std::int16_t, 16>;
  using Bytes = std::array<std::uint8_t, 32>;
  alignas(32) std::array<Bytes, 6> term;     ///< picks coefficient t of a record's x, and of its y
  alignas(32) Shorts i, ii;                  ///< i and i * i for the columns of a row, twice: for x and for y
  alignas(32) Shorts quarters_i;             ///< i for two rows, ordered by quarters
  alignas(32) Shorts lower_row;              ///< all bits set for the lower of the two rows
  alignas(32) std::array<Shorts, 2> shifts;  ///< by half: shifts the quarters' first rows to the row bits of y
  alignas(32) Shorts row_bits, share_bits, share_by, one_across, half_level;
  alignas(32) Bytes one;
  alignas(32) std::array<Bytes, kPatch> before;  ///< by row y: Places::row is larger for pixels with upper row >= y - 1
};
constexpr Constants constants() {
  Constants c{};
  for (std::size_t k = 0; k < 16; ++k) {
    c.i[k] = static_cast<std::int16_t>(k % 8);
    c.ii[k] = static_cast<std::int16_t>(k % 8 * (k % 8));
    c.quarters_i[k] = static_cast<std::int16_t>(k / 8 * 4 + k % 4);
    c.lower_row[k] = k / 4 % 2 == 0 ? 0 : -1;
    for (std::size_t half = 0; half < 2; ++half) {
      c.shifts[half][k] = static_cast<std::int16_t>(k % 2 == 0 ? 12 - 8 * half - k / 8 * 4 : 0);
    }
    c.row_bits[k] = static_cast<std::int16_t>(0xf000);
    c.share_bits[k] = 127;
    c.share_by[k] = -255;
    c.one_across[k] = 128;
    c.half_level[k] = 64;
  }
  for (std::size_t k = 0; k < 32; ++k) {
    for (std::size_t t = 0; t < 6; ++t) c.term[t][k] = static_cast<std::uint8_t>(2 * t + k % 2);
    c.one[k] = 1;
    for (std::size_t y = 2; y < kPatch; ++y) c.before[y][k] = static_cast<std::uint8_t>(8 * (y - 1) - 1);
  }
  return c;
}
constexpr Constants kConstants = constants();

/// Half a tile in two registers: its upper two rows, its lower two rows. Each 128-bit lane holds one quarter's part.
struct Rows {
  V upper;
  V lower;
};

/// A quadratic over a tile: two rows, their difference to the next two rows, and the increment of that difference.
struct Rising {
  V at, by, more;

  [[gnu::always_inline]] Rows half() {
    const V upper = at;
    const V lower = add(upper, by);
    by = add(by, more);
    at = add(lower, by);
    by = add(by, more);
    return {upper, lower};
  }
};

/// A bilinear polynomial over a tile: coefficients of 1, i, j, ij.
struct Bilinear {
  V at, by;

  [[gnu::always_inline]] void set(const Constants& k, const std::int16_t* q) {
    const V by_j = add(all(q[2]), mul(all(q[3]), load(&k.quarters_i)));
    const V row = add(all(q[0]), mul(all(q[1]), load(&k.quarters_i)));
    at = add(row, _mm256_and_si256(by_j, load(&k.lower_row)));
    by = add(by_j, by_j);
  }
  [[gnu::always_inline]] Rows half() {
    const Rows rows{at, add(at, by)};
    at = add(rows.lower, by);
    return rows;
  }
};

/// Reorders two rows so that each 128-bit lane holds one quarter's part of them. It is its own inverse.
inline V by_quarters(V rows) { return _mm256_permute4x64_epi64(rows, 0xd8); }
/// Loads half a tile from 64 values, one per pixel.
template <class Number>
[[gnu::always_inline]] inline Rows listed_half(const Number* values, std::size_t half) {
  const Number* from = values + half * kTilePixels / 2;
  return {by_quarters(load(from)), by_quarters(load(from + 2 * kTile))};
}
inline void list_half(Rows rows, std::size_t half, std::int16_t* values) {
  std::int16_t* to = values + half * kTilePixels / 2;
  _mm256_storeu_si256(reinterpret_cast<V*>(to), by_quarters(rows.upper));
  _mm256_storeu_si256(reinterpret_cast<V*>(to + 2 * kTile), by_quarters(rows.lower));
}

/// The patch coordinates of half a tile's pixels, in the form that interpolation needs.
struct Places {
  V column;     ///< bytes, by pixel: column of the left samples
  V row;        ///< bytes: 8 times the row of the upper samples, relative to the quarter's first row, plus a fraction
  Rows across;  ///< byte pairs: the shares of the left and the right sample, in -1/128, because -128 fits a byte
  Rows down;    ///< the lower row's share, in 1/2^15; minus one if the upper row, relative to the first, is odd
};

/// Places::across for two rows.
[[gnu::always_inline]] inline V across_shares(const Constants& k, V x) {
  const V share = _mm256_and_si256(_mm256_srli_epi16(x, 5), load(&k.share_bits));
  return add(mul(share, load(&k.share_by)), load(&k.one_across));
}

[[gnu::always_inline]] inline Places places(const Constants& k, Rows x, Rows y, V first_row) {
  y = {_mm256_sub_epi16(y.upper, first_row), _mm256_sub_epi16(y.lower, first_row)};
  return {_mm256_packus_epi16(_mm256_srli_epi16(x.upper, 12), _mm256_srli_epi16(x.lower, 12)),
          _mm256_packus_epi16(_mm256_srli_epi16(y.upper, 9), _mm256_srli_epi16(y.lower, 9)),
          {across_shares(k, x.upper), across_shares(k, x.lower)},
          {_mm256_slli_epi16(y.upper, 3), _mm256_slli_epi16(y.lower, 3)}};
}

struct Positions {
  Rows x, y;
};

/// Computes the coordinates of a record's pixels; call half() for half 0, then for half 1.
class Coordinates {
 public:
  [[gnu::always_inline]] Coordinates(const Constants& k, const GridTable& grid, const PatchRecord& record) {
    std::int16_t first;
    std::memcpy(&first, record.first.data(), sizeof first);
    first_ = all(first);
    if (record.listed()) {
      list_ = grid.coordinates.data() + record.list() * 2 * kTilePixels;
      return;
    }
    const V both = load(&record);  // x in the lower 128 bits, y in the upper, as in the terms below
    const auto term = [&](std::size_t t) { return _mm256_shuffle_epi8(both, load(&k.term[t])); };
    const V by_j = add(term(2), mul(term(3), load(&k.i)));
    const V row = add(add(term(0), mul(term(1), load(&k.i))), mul(term(4), load(&k.ii)));
    const V by_jj = term(5);
    const V by = add(add(by_j, by_j), _mm256_slli_epi16(by_jj, 2));
    const auto apart = [&](V upper, V lower, V& x, V& y) {
      const V left = _mm256_unpacklo_epi64(upper, lower);
      const V right = _mm256_unpackhi_epi64(upper, lower);
      x = _mm256_permute2x128_si256(left, right, 0x20);
      y = _mm256_permute2x128_si256(left, right, 0x31);
    };
    apart(row, add(row, add(by_j, by_jj)), x_.at, y_.at);
    apart(by, add(by, _mm256_slli_epi16(by_jj, 2)), x_.by, y_.by);
    const V more = _mm256_slli_epi16(by_jj, 3);
    x_.more = _mm256_permute4x64_epi64(more, 0x44);
    y_.more = _mm256_permute4x64_epi64(more, 0xee);
  }
  [[gnu::always_inline]] Places half(const Constants& k, std::size_t half) {
    const V first_row = _mm256_and_si256(_mm256_sllv_epi32(first_, load(&k.shifts[half])), load(&k.row_bits));
    if (list_ != nullptr) return places(k, listed_half(list_, half), listed_half(list_ + kTilePixels, half), first_row);
    return places(k, x_.half(), y_.half(), first_row);
  }
  /// The coordinates themselves, instead of half().
  [[gnu::always_inline]] Positions positions(std::size_t half) {
    if (list_ != nullptr) return {listed_half(list_, half), listed_half(list_ + kTilePixels, half)};
    return {x_.half(), y_.half()};
  }

 private:
  const std::uint16_t* list_ = nullptr;
  V first_;
  Rising x_{};
  Rising y_{};
};

}  // namespace
}  // namespace nodal::blend
