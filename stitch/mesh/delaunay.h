// Spherical Delaunay triangles.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "stitch/geometry/raymap/scattered_rays.h"

namespace nodal::mesh {

/// Triangles of pixels, row * width + column, whose rays have no other ray in their common circle; together the convex
/// hull of the rays. Four rays on one circle, to 1e-5 of their distance, are cut in one of the two ways.
/// Counter-clockwise as the nodal point sees them. Where the rays leave more than a hemisphere free there are no
/// triangles.
std::vector<std::array<std::uint32_t, 3>> delaunay(const geometry::ScatteredRays& rays);

}  // namespace nodal::mesh
