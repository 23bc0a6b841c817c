// The rays of a raymap in tiles, over which the objective is summed.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/parallel/workers.h"
#include "stitch/registration/tile_kernel.h"

namespace nodal::registration {

/// A layout whose largest pixels are as large as those of an equirectangular layout of this width.
/// Errors: those of make_layout.
Result<std::unique_ptr<geometry::RaymapLayout>> layout_of_width(const std::string& name, int width);

/// Every ray of the layout once, with its solid angle, neighbours in one tile. Tiles for which `wanted` (which sees
/// only axis and radius) returns false are left out.
std::vector<Tile> make_tiles(const geometry::RaymapLayout& layout, const parallel::Workers& workers,
                             const std::function<bool(const Tile&)>& wanted);

}  // namespace nodal::registration
