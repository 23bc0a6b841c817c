// What a head does to rays, as pairs: for fitting another lens to it and for comparing two heads.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "stitch/geometry/head.h"
#include "stitch/geometry/ray.h"

namespace nodal::geometry {

/// A ray in the head's frame and where it falls, px with corners at integers.
struct RayPixel {
  Eigen::Vector3d ray{0, 0, 1};
  Pixel pixel;
};

/// What a head does to its rays, at some thousand places spread evenly over what its region holds.
std::vector<RayPixel> sample_head(const Head& head);

}  // namespace nodal::geometry
