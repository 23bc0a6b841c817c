// Tiles of a smooth layout that one head fills: thirteen rays determine the places of all pixels.
#pragma once

#include <array>
#include <optional>

#include "stitch/blend/blend_table.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::table {

/// A tile in which one head has the whole weight of every pixel. By pixel, 8 j + i.
struct ClearTile {
  HeadIndex head = 0;
  std::array<double, blend::kTilePixels> x, y;  ///< samples of the head's component plane, as in RaySample
  std::array<double, blend::kTilePixels> gain;  ///< as in RaySample
};

/// The tile whose first sample is (left, top), if the layout is smooth and one head has the whole weight all over it,
/// by the limits of the scores' slopes or by the tile's distance from the seam. Positions are a biquadratic polynomial
/// through nine of them, within a quarter of kPatchFit of what RowSampler computes. Nothing without seams.
std::optional<ClearTile> clear_tile(const RaySampler& sampler, int grid, int left, int top);

/// Whether the layout is smooth, and at most one head can see rays of the tile. Quick, but may be false although it
/// holds.
bool has_one_head_at_most(const RaySampler& sampler, int grid, int left, int top);

}  // namespace nodal::table
