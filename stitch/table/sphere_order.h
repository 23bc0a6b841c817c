// For layouts whose neighbouring pixels hold no neighbouring rays: sorts the rays into tiles of neighbouring rays, so that
// a blend of them reads few patches.
#pragma once

#include <cstdint>
#include <vector>

#include "stitch/table/ray_sampler.h"

namespace nodal::table {

/// GridTable::places of a grid of the raymap. The sphere is cut into strips along circles of latitude, as high as 8 of
/// as many rays spread evenly; each is cut into runs of as many rays as a tile has pixels, which are laid into it by
/// longitude across and latitude down. Rays of an even list so lie about as in a tile of a picture; of others, tiles are
/// longer than high or the other way round, and cost more patches. Pixels that hold no ray come last. Where sides are
/// multiples of 8, so that tiles are whole, they are made in blocks of about 8 by 8.
std::vector<std::uint32_t> sphere_order(const RaySampler& sampler, int grid);

}  // namespace nodal::table
