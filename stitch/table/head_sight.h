// What a head sees of a ray: the pixel, how many pixels a steradian has there, and how far inside the region it is.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "stitch/geometry/head.h"
#include "stitch/geometry/ray.h"
#include "stitch/table/tabled_lens.h"

namespace nodal::table {

struct HeadSight {
  geometry::Pixel pixel;
  double density = 0;  ///< original pixels per steradian
  double inside = 0;   ///< px to the nearest edge of what Head::contains() accepts; negative outside
  /// 0 at the edges of the region, 1 far inside: the product of a smoothstep for each edge. Unlike that of `inside`, its
  /// slope is continuous where the nearest edge changes, which seams need (seam.h).
  double depth = 0;
};

/// What Head::project, Head::density and Head::distance_to_edge return (a test compares them), in one pass and from lookup
/// tables. `direction` is a unit vector in the head's frame; depth is 1 at 1 / `depth_per_px` px from every edge. Nothing
/// beyond the lens's max_angle.
std::optional<HeadSight> see(const geometry::Head& head, const TabledLens& lens, const Eigen::Vector3d& direction,
                             double depth_per_px);

/// 0 up to 0, 1 from 1 on, with a continuous slope.
double smoothstep(double t);

/// Half of the shorter side of a region, px: what feathers are relative to.
double half_of_region(const Region& region);

}  // namespace nodal::table
