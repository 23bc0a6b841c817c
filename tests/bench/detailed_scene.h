// A sphere of random detail as a function of the ray, for measuring what raymaps and codecs keep of it.
#pragma once

#include <Eigen/Core>

#include "stitch/geometry/ray.h"

namespace nodal::bench {

/// Where a DetailedScene has its fine detail.
enum class Detail {
  kEverywhere,
  kHorizon,  ///< falls off with latitude as a Gaussian of 0.2 rad; coarse shapes remain everywhere
};

/// Grey levels, about 20 to 236: octaves of smooth random values on a lattice in space, cells from 1/3 rad to 1/384
/// rad, each 0.8 times as strong as the one before. The lattice is turned against the axes, so that no face of a layout
/// lies along it.
///
/// Threading: immutable; any thread.
class DetailedScene {
 public:
  explicit DetailedScene(Detail detail);
  double level(const Eigen::Vector3d& ray) const;

 private:
  Detail detail_;
  Eigen::Matrix3d R_lattice_rig_;
};

}  // namespace nodal::bench
