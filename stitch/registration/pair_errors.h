// Errors of point pairs in the heads' pictures, and their derivatives.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/head.h"

namespace nodal::registration {

/// A point of a pair in the picture of one head.
struct PairEnd {
  std::size_t head;
  geometry::Pixel pixel;
  double pixels_per_radian;  ///< there, with the prior's lens, so that it does not change with the estimate
};

/// A head in its own frame: with the estimated focal length, and with those a small step above and below it if focal
/// lengths are estimated.
struct HeadLens {
  geometry::Head at;
  std::optional<geometry::Head> above, below;
};
using Lenses = std::vector<HeadLens>;

/// The heads of `prior` with changed focal lengths; `log_focal`: the logarithm of the change, one per head.
/// Errors: those of geometry::Head::make.
Result<Lenses> make_lenses(const Calibration& prior, const std::vector<double>& log_focal, bool focals);

/// The point of `from` as the head of `to` sees it.
///
/// The error is a distance in the picture, divided by the prior's pixels per radian. The noise of points is constant in
/// pictures; errors as angles between rays would prefer long focal lengths, with which all angles are smaller.
struct SeenEnd {
  Eigen::Vector2d error;  ///< where it is seen, less where the pair has it; rad
  /// Derivatives by a small turn of each head (in its own frame), and by the logarithm of its focal length (0 if focal
  /// lengths are not estimated).
  Eigen::Matrix<double, 2, 3> by_turn_from, by_turn_to;
  Eigen::Vector2d by_focal_from = Eigen::Vector2d::Zero(), by_focal_to = Eigen::Vector2d::Zero();
};

/// Nothing where a lens does not reach the point. `R_head_rig`: of all heads.
std::optional<SeenEnd> seen_in(const std::vector<Eigen::Matrix3d>& R_head_rig, const Lenses& lenses,
                               const PairEnd& from, const PairEnd& to);

}  // namespace nodal::registration
