// The rays of a raymap in tiles: where the objective is summed.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/registration/parallel.h"
#include "stitch/registration/tile_kernel.h"

namespace nodal::registration {

/// A layout with about as many rays as an equirectangular one `width` wide.
/// Errors: those of make_layout.
Result<std::unique_ptr<geometry::RaymapLayout>> layout_of_width(const std::string& name, int width);

/// Every ray of the layout once, with its solid angle, neighbours together. Tiles for which `wanted` says no after
/// only a look at their axis and radius are left out.
std::vector<Tile> make_tiles(const geometry::RaymapLayout& layout, const Workers& workers,
                             const std::function<bool(const Tile&)>& wanted);

}  // namespace nodal::registration
