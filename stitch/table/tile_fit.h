// Fits polynomials over the pixels of a tile, and rounds them to the table's integers.
#pragma once

#include <array>
#include <cstdint>

#include "stitch/blend/blend_table.h"

namespace nodal::table {

/// One bit per pixel of a tile: (i, j) is bit 8 j + i.
using PixelMask = std::uint64_t;
inline constexpr PixelMask pixel_bit(int i, int j) { return PixelMask{1} << (8 * j + i); }
/// The pixels of a tile in columns [left, right) and rows [top, bottom).
struct Block {
  int left = 0;
  int top = 0;
  int right = blend::kTile;
  int bottom = blend::kTile;
};
PixelMask block_mask(const Block& block);

/// Whole numbers by pixel, 8 j + i.
using PixelValues = std::array<std::int32_t, blend::kTilePixels>;

/// The quadratic that is nearest to `values` over the pixels of `mask` in the least squares, its coefficients rounded
/// one after the other so that each makes up for what rounding the ones before it has cost. Made of whole numbers by
/// additions, multiplications and divisions alone: the same on every machine.
std::array<std::int32_t, 6> fit_quadratic(const PixelValues& values, PixelMask mask);

/// The same of 1, i, j, ij.
std::array<std::int32_t, 4> fit_bilinear(const PixelValues& values, PixelMask mask);

}  // namespace nodal::table
