// The raymaps on an upright cylinder.
#pragma once

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// theta = 2 pi (x / W - 1/2), sin phi = 2 y / H - 1 (Archimedes, Lambert 1772): the whole sphere, and every pixel
/// spans exactly 4 pi / (W H).
Result<std::unique_ptr<RaymapLayout>> make_cylinder_equal_area(RaymapSize size, std::int64_t);

/// theta = 2 pi (x / W - 1/2), tan phi = (2 y / H - 1) tan(fov / 2): what the nodal point sees on a cylinder around it,
/// FFmpeg's `cylindrical`. It holds rays up to fov / 2 above and below the horizon. The largest pixels are at the
/// horizon.
Result<std::unique_ptr<RaymapLayout>> make_central_cylinder(RaymapSize size, std::int64_t fov_deg);

/// theta = 2 pi (x / W - 1/2), asinh(tan phi) = pi (2 y / H - 1) (Mercator 1569), FFmpeg's `mercator`: at W = H it
/// keeps all angles. It holds rays up to atan(sinh pi), 85.05 degrees, above and below the horizon. The largest pixels
/// are at the horizon.
Result<std::unique_ptr<RaymapLayout>> make_mercator(RaymapSize size, std::int64_t);

}  // namespace nodal::geometry
