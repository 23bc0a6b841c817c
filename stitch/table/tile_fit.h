// Fits polynomials over the pixels of a tile, and rounds them to the table's integers.
#pragma once

#include <array>
#include <cstdint>

#include "stitch/blend/blend_table.h"

namespace nodal::table {

/// One bit per pixel of a tile: (i, j) is bit 8 j + i.
using PixelMask = std::uint64_t;
inline constexpr PixelMask pixel_bit(int i, int j) { return PixelMask{1} << (8 * j + i); }
/// Calls `each` with the index of every pixel of the mask.
template <class Each>
void for_each(PixelMask mask, Each each) {
  for (; mask != 0; mask &= mask - 1) each(static_cast<std::size_t>(__builtin_ctzll(mask)));
}
/// The pixels of a tile in columns [left, right) and rows [top, bottom).
struct Block {
  int left = 0;
  int top = 0;
  int right = blend::kTile;
  int bottom = blend::kTile;
};
PixelMask block_mask(const Block& block);

/// Integers by pixel, at index 8 j + i.
using PixelValues = std::array<std::int32_t, blend::kTilePixels>;

/// The smallest and the largest of some pixels' values.
struct Span {
  std::int32_t least = INT32_MAX;
  std::int32_t most = INT32_MIN;
};
Span span_of(const PixelValues& values, PixelMask mask);

/// The least-squares quadratic of `values` over the pixels of `mask`. Coefficients are rounded one after the other, and
/// each compensates the rounding errors of those before. Computed from integers by additions, multiplications and
/// divisions only, so the result is the same on every machine.
std::array<std::int32_t, 6> fit_quadratic(const PixelValues& values, PixelMask mask);

/// The same with the terms 1, i, j, ij only.
std::array<std::int32_t, 4> fit_bilinear(const PixelValues& values, PixelMask mask);

}  // namespace nodal::table
