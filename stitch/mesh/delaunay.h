// Spherical Delaunay triangles.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "stitch/geometry/raymap/scattered_rays.h"

namespace nodal::mesh {

/// Triangles of pixels (row * width + column) with no other ray inside the circle through their three rays; together
/// they are the convex hull of the rays. Four rays on one circle, within 1e-5 of their distance, are cut in one of the
/// two ways. Triangles are counter-clockwise as seen from the nodal point. There are none where the rays leave more
/// than a hemisphere free.
std::vector<std::array<std::uint32_t, 3>> delaunay(const geometry::ScatteredRays& rays);

}  // namespace nodal::mesh
