// Interpolation between the rays of a scattered raymap (§4.5).
#pragma once

#include <vector>

#include "stitch/geometry/raymap/scattered_rays.h"

namespace nodal::view {

/// A pixel that contributes to the value of a ray.
struct Neighbour {
  int i = 0, j = 0;
  double weight = 0;
};

/// The natural neighbours of a ray: the pixels that the ray's Voronoi cell on the sphere would touch if it were a
/// pixel. Each weighs the length of their common edge divided by their distance (Belikov et al. 1997: exact for
/// functions that are linear about the ray); edges are measured on the tangent plane. Weights sum to 1. A pixel's own
/// ray gives that pixel.
std::vector<Neighbour> natural_neighbours(const geometry::ScatteredRays& rays, const geometry::Ray& ray);

}  // namespace nodal::view
