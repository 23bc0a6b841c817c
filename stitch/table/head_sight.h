// A ray as one head sees it: the pixel, the pixels per steradian there, and the distance from the edges of the region.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <optional>

#include "stitch/geometry/head.h"
#include "stitch/geometry/ray.h"
#include "stitch/table/tabled_lens.h"

namespace nodal::table {

struct HeadSight {
  geometry::Pixel pixel;
  double density = 0;  ///< original pixels per steradian
  double inside = 0;   ///< px to the nearest edge of what Head::contains() accepts; negative outside
  /// 0 at the edges of the region, 1 far inside: the product of a smoothstep for each edge. Its slope is continuous
  /// where the nearest edge changes (the slope of `inside` is not), which seams need (seam.h).
  double depth = 0;
};

/// The values of Head::project, Head::density and Head::distance_to_edge (a test compares them), in one pass and from
/// lookup tables. `direction` is a unit vector in the head's frame; depth is 1 at 1 / `depth_per_px` px from every
/// edge. Nothing beyond the lens's max_angle.
std::optional<HeadSight> see(const geometry::Head& head, const TabledLens& lens, const Eigen::Vector3d& direction,
                             double depth_per_px);

/// 0 for x <= 0, 1 for x >= 1, with a continuous slope.
inline double smoothstep(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// Half of the shorter side of a region, px: the unit of TableOptions::feather.
double half_of_region(const Region& region);

}  // namespace nodal::table
