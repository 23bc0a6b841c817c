// Checks whether two pictures have as much in common as a rotation between them implies.
#pragma once

#include <vector>

#include "stitch/autocalibration/arrangement.h"
#include "stitch/autocalibration/features.h"
#include "stitch/autocalibration/matches.h"

namespace nodal::autocalibration {

/// Two heads that look in about the same direction see the same things, so their features match in most of the picture.
/// If a rotation implies this, but only a few features match, or only at the rim, the rotation is a coincidence.
///
/// Threading: thread-safe.
class InCommon {
 public:
  /// All three must outlive this.
  InCommon(const std::vector<Shape>& shapes, const std::vector<std::vector<Feature>>& features,
           const std::vector<Match>& matches);

  /// How many matches of the pictures a < b agree with this rotation and lens; 0 if they are too few for what the
  /// pictures would share.
  double agreeing(std::size_t a, std::size_t b, const Eigen::Matrix3d& R_b_a, const SharedLens& lens) const;

 private:
  const std::vector<Shape>& shapes_;
  const std::vector<std::vector<Feature>>& features_;
  std::vector<std::vector<Match>> of_pair_;  ///< [a * pictures + b]
};

}  // namespace nodal::autocalibration
