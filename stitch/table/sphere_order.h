// For layouts whose neighbouring pixels hold no neighbouring rays: sorts the rays into tiles of neighbouring rays, so
// that a blend of them reads few patches.
#pragma once

#include <cstdint>
#include <vector>

#include "stitch/table/ray_sampler.h"

namespace nodal::table {

/// The order in which a grid's pixels are blended.
struct SphereOrder {
  std::vector<std::uint32_t> places;  ///< GridTable::places
  std::vector<std::uint32_t> cells;   ///< the first tile of each cell of the layout, rising; empty without cells
};

/// The sphere is cut into strips along circles of latitude. A strip is as high as 8 rays would be apart if all rays
/// were spread evenly. Each strip is cut by longitude into runs of as many rays as a tile has pixels; in the tile,
/// columns follow longitude and rows follow latitude. If the rays are spread evenly, a tile is about square on the
/// sphere; if not, tiles are elongated and need more patches. Pixels without a ray come last. If both sides of the grid
/// are multiples of 8 (all tiles are whole), tiles are ordered in blocks of about 8 by 8.
///
/// If the layout has a regular order (RaymapLayout::cells), each of its cells is cut in this way, cell after cell: some
/// of them together, a batch (batches.h), then write long runs of pixels.
SphereOrder sphere_order(const RaySampler& sampler, int grid);

}  // namespace nodal::table
