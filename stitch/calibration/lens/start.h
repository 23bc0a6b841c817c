// From matched points to a first lens and first poses: radial alignment (Tsai 1987), valid for any radial lens; then a
// linear fit of the lens as a polynomial; then least squares on the points.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/calibration/lens/lens_model.h"

namespace nodal::solve {
struct Evaluation;
}

namespace nodal::calibration {

/// A hypothesis: a point of a photograph (px) shows a point of the pattern (pattern widths from its
/// centre).
struct PointPair {
  Eigen::Vector2d photo;
  Eigen::Vector2d pattern;
};

/// A lens, and the pattern's pose in each photograph.
struct Arrangement {
  LensParameters lens;
  std::vector<Pose> poses;
};

/// The part of a photograph's pose that can be found without the lens: two rows of the rotation and of t, up to a
/// common sign.
struct RadialPose {
  Eigen::Matrix<double, 2, 3> rows;  ///< (x, y) in the head's frame = rows (X, Y, 1), in pattern widths
  Eigen::Vector2d third;             ///< r31, r32, up to their common sign
  std::vector<PointPair> inliers;
  double tilt() const;  ///< rad, between the pattern's normal and the lens's axis
};

/// The pose that most pairs fit; nothing if fewer than kMinPairs do. `center` and `aspect` are estimates.
inline constexpr int kMinPairs = 20;
std::optional<RadialPose> radial_pose(const std::vector<PointPair>& pairs, const Eigen::Vector2d& center, double aspect,
                                      double tolerance_px);

/// A first lens and first poses, for photographs with known radial poses.
/// Errors: kNotDetermined if no photograph is tilted enough to separate focal length from distance.
Result<Arrangement> first_arrangement(const std::vector<RadialPose>& views, LensKind kind,
                                      const Eigen::Vector2d& center, double aspect);

/// The arrangement after a step. A step holds the lens's parameters, then `own` numbers per photograph; the first six
/// of these rotate and shift its pose.
Arrangement moved(const Arrangement& arrangement, const Eigen::VectorXd& step, int own);

/// Fits the arrangement to the point pairs by least squares, then drops the pairs that are outliers.
/// `fixed_lens` marks lens parameters that are held. Returns the median distance before dropping,
/// px.
double refine_on_points(std::vector<std::vector<PointPair>>& pairs, const std::vector<bool>& fixed_lens,
                        double huber_px, Arrangement& arrangement);

/// The residuals of the point pairs, px, with their derivatives by the arrangement's unknowns as moved() takes them.
solve::Evaluation evaluated_on_points(const Arrangement& arrangement, const std::vector<std::vector<PointPair>>& pairs,
                                      double huber_px);

}  // namespace nodal::calibration
