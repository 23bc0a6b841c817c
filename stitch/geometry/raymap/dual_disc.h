// The raymaps of two discs, each a hemisphere: front on the left, back on the right.
#pragma once

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// In each square half of the picture a disc of radius H / 2 px about the axis of a camera that looks forward or back,
/// upright. With r the distance from the disc's centre over its radius, the ray is at the angle alpha from the axis.
/// Every pixel that a disc touches holds a ray; those on the rim continue the formula beyond 90 degrees and represent
/// the part of them that is within the disc.

/// alpha = r pi / 2: what two ideal fisheyes see. The largest pixels are in the middle, pi / H apart;
/// max / min = pi / 2.
Result<std::unique_ptr<RaymapLayout>> make_dual_fisheye(RaymapSize size, std::int64_t);

/// r = tan(alpha / 2): the reflection in a paraboloid (Heidrich and Seidel 1998), which is the stereographic
/// projection. The largest pixels are in the middle, 4 / H apart; max / min = 4 (§4.2).
Result<std::unique_ptr<RaymapLayout>> make_dual_paraboloid(RaymapSize size, std::int64_t);

}  // namespace nodal::geometry
