// Where half a tile's pixels lie in a patch, and what else is a polynomial over a tile, for AVX2: two rows at a time,
// and the next two by how much they are more. Internal to blend_avx2.cpp, which includes it where it compiles for those
// instructions.
#pragma once

#include <immintrin.h>

#include <array>
#include <cstdint>
#include <cstring>

#include "stitch/blend/blend_job.h"
#include "stitch/blend/patch_avx2.h"

namespace nodal::blend {
namespace {

/// What is constant, in memory: the compiler would make it anew wherever it is used, by three instructions out of one
/// number; as an instruction's operand it costs nothing.
struct Constants {
  using Shorts = std::array<std::int16_t, 16>;
  using Bytes = std::array<std::uint8_t, 32>;
  alignas(32) std::array<Bytes, 6> term;     ///< picks number t of a record's x, and of its y
  alignas(32) Shorts i, ii;                  ///< of a row, for x and for y
  alignas(32) Shorts quarters_i;             ///< of two rows by quarters
  alignas(32) Shorts lower_row;              ///< all bits where they are the lower of the two
  alignas(32) std::array<Shorts, 2> shifts;  ///< by half: brings the quarters' first rows up to where y has its row
  alignas(32) Shorts row_bits, share_bits, share_by, one_across, half_level;
  alignas(32) Bytes one;
  alignas(32) std::array<Bytes, kPatch> before;  ///< by row, just less than the row above it, as Places::row counts
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

/// Half a tile in two registers: its upper two rows, and its lower two. A 128-bit lane is a quarter's part of them.
struct Rows {
  V upper;
  V lower;
};

/// A quadratic over a tile: two rows, how much more the next two are, and how much more than so much those after them.
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

/// Four coefficients of 1, i, j, ij over a tile.
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

/// Two rows of a tile, by what their quarters have of them. Back again by the same way.
inline V by_quarters(V rows) { return _mm256_permute4x64_epi64(rows, 0xd8); }
/// 64 values by pixel, of half a tile.
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

/// Where half a tile's pixels lie in a patch, ready for use.
struct Places {
  V column;     ///< bytes, by pixel: of the left samples
  V row;        ///< bytes: 8 times that of the upper samples, from their quarter's first on, and a fraction
  Rows across;  ///< pairs of bytes: the shares of the left and the right sample, of -128: one is then a byte
  Rows down;    ///< the lower row's share, of 2^15; less one where the upper row is odd, from the first on
};

[[gnu::always_inline]] inline Places places(const Constants& k, Rows x, Rows y, V first_row) {
  const auto across = [&](V of) {
    const V share = _mm256_and_si256(_mm256_srli_epi16(of, 5), load(&k.share_bits));
    return add(mul(share, load(&k.share_by)), load(&k.one_across));
  };
  y = {_mm256_sub_epi16(y.upper, first_row), _mm256_sub_epi16(y.lower, first_row)};
  return {_mm256_packus_epi16(_mm256_srli_epi16(x.upper, 12), _mm256_srli_epi16(x.lower, 12)),
          _mm256_packus_epi16(_mm256_srli_epi16(y.upper, 9), _mm256_srli_epi16(y.lower, 9)),
          {across(x.upper), across(x.lower)},
          {_mm256_slli_epi16(y.upper, 3), _mm256_slli_epi16(y.lower, 3)}};
}

/// Both coordinates of a record's pixels.
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
    const V both = load(&record);  // x below, y above, as in all that follows
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

 private:
  const std::uint16_t* list_ = nullptr;
  V first_;
  Rising x_{};
  Rising y_{};
};

}  // namespace
}  // namespace nodal::blend
