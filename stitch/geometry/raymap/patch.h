// Parts of a raymap in which its ray is a smooth function of the place: what triangle meshes are made of.
#pragma once

#include <functional>

#include "stitch/geometry/ray.h"

namespace nodal::geometry {

/// A place of the picture and its ray. At a seam, a place has several; this is the patch's own.
struct PatchPoint {
  Pixel at;
  Ray ray;
};

/// A smooth image of the unit square, or of the triangle (0, 0), (1, 0), (0, 1), in the picture and on the sphere.
/// Patches meet along whole sides. `at` may be left or right of the picture where it continues on its other side. It
/// keeps the layout by reference.
struct LayoutPatch {
  bool triangle = false;
  int across = 1, down = 1;  ///< about square cells; down = 0: one row, however fine the mesh is
  std::function<PatchPoint(double u, double v)> point;
};

}  // namespace nodal::geometry
