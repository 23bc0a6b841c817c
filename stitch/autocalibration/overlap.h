// Checks whether two pictures agree where they should overlap, because matches alone are deceived by repeating
// patterns.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "stitch/autocalibration/arrangement.h"
#include "stitch/autocalibration/picture.h"

namespace nodal::autocalibration {

/// The detail of small pictures, to be compared through any lens.
///
/// Threading: immutable.
class Overlaps {
 public:
  /// `small`: one picture per head, reduced by any whole number.
  Overlaps(const std::vector<Shape>& shapes, const std::vector<Picture>& small);

  /// The correlation of the two heads' detail on the rays that both see; kCannotTell if there are too few rays or too
  /// little detail.
  double correlation(std::size_t a, std::size_t b, const Eigen::Matrix3d& R_b_a, const SharedLens& lens_a,
                     const SharedLens& lens_b) const;

  static constexpr double kCannotTell = 0.5;

 private:
  struct Detail {
    Picture picture;
    double scale = 1;  ///< units of radius per pixel
    Eigen::Vector2d center{0, 0};
    double radius = 0;                 ///< radius of the image circle, px; 0: none
    std::vector<std::uint8_t> masked;  ///< by pixel: 1 if it is masked, or near to what is; empty: none is
  };
  std::vector<Detail> details_;
};

}  // namespace nodal::autocalibration
