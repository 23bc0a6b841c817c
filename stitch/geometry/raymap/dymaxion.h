// Fuller's dymaxion map: an icosahedron unfolded around the oceans of the Earth (§5).
#pragma once

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// Fuller's icosahedron and net on 5.5 by 3 triangles, the Earth's north pole up and its meridian of Greenwich forward;
/// his two cut triangles stay whole. Along edges the scale is constant; inside, R. W. Gray's exact equations for
/// Fuller's construction ("Exact transformation equations for Fuller's world map", Cartographica 32, 1995). The solid
/// angle of a pixel is that of the spherical polygon of its corners: neighbours share them, so that the sum is the
/// sphere; single pixels are off by about (pixel / edge of a triangle)^2 / 10.
Result<std::unique_ptr<RaymapLayout>> make_dymaxion(RaymapSize size, std::int64_t);

/// The width of the net divided by the angle of a pixel in the middle of a triangle, where pixels are largest.
double dymaxion_radians_across();

}  // namespace nodal::geometry
