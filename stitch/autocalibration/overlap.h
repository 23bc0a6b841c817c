// Whether two pictures show the same where they should overlap: matches alone are deceived by things that repeat.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "stitch/autocalibration/arrangement.h"
#include "stitch/autocalibration/picture.h"

namespace nodal::autocalibration {

/// The detail of small pictures, to be compared through any lens.
///
/// Threading: immutable.
class Overlaps {
 public:
  /// `small`: one a head, reduced by any whole number.
  Overlaps(const std::vector<Shape>& shapes, const std::vector<Picture>& small);

  /// The correlation of the two heads' detail on the rays that both see; kCannotTell if these are few or have no
  /// detail.
  double correlation(std::size_t a, std::size_t b, const Eigen::Matrix3d& R_b_a, const SharedLens& lens_a,
                     const SharedLens& lens_b) const;

  static constexpr double kCannotTell = 0.5;

 private:
  struct Detail {
    Picture picture;
    double scale = 1;  ///< units of radius a pixel
    Eigen::Vector2d center{0, 0};
    double radius = 0;  ///< px; of the image circle, 0: none
  };
  std::vector<Detail> details_;
};

}  // namespace nodal::autocalibration
