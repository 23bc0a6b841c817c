// A head's projection sampled as pairs of ray and pixel: for fitting another lens to it and for comparing two heads.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "stitch/geometry/head.h"
#include "stitch/geometry/ray.h"

namespace nodal::geometry {

/// A ray in the head's frame and its position in the picture, px with corners at integers.
struct RayPixel {
  Eigen::Vector3d ray{0, 0, 1};
  Pixel pixel;
};

/// Pairs at some thousand points spread evenly over the head's region.
std::vector<RayPixel> sample_head(const Head& head);

}  // namespace nodal::geometry
