// Seams between heads: the head with the best score for a ray is used, with a linear ramp across the seam.
#pragma once

#include <Eigen/Core>
#include <span>

namespace nodal::table {

/// One head that sees a ray.
struct SeamCandidate {
  double score = 0;  ///< > 0; the head with the largest one is the best
  /// Change of the score per radian along two orthogonal tangents of the sphere at the ray, the same for all heads.
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  double weight = 0;  ///< result, not yet scaled to a sum of 1
};

/// Computes the weights for seams of `width` radians, 0 or more.
///
/// The seam between two heads is where their scores a and b are equal. Let q = (a - b) / (a + b) be their relative
/// difference. The distance from the seam is q / |grad q| to first order (exactly, if both scores are linear). Let x be
/// that distance divided by width / 2, but at least q. The worse head's weight is (1 - x) / (1 + x), and 0 from x = 1
/// on; the best head's weight is 1. Between two heads the smaller share is then (1 - x) / 2: a linear ramp from one
/// half to 0, `width` wide on both sides together. At the edge of a head's region its score is 0, so q is 1 and its
/// weight 0 for every width: a seam wider than the overlap fills the overlap.
void apply_seam(std::span<SeamCandidate> candidates, double width);

/// What is known of a score near a ray.
struct ScoreLimits {
  double least = 0, most = 0;
  double slope = 0;  ///< the largest change per radian
};
/// Whether `better` has the whole weight and `worse` none, wherever their scores and slopes are within these limits:
/// x >= 1 of apply_seam(), as (a - b) (a + b) >= width |b grad a - a grad b|. False also if it is not known.
bool beyond_ramp(const ScoreLimits& better, const ScoreLimits& worse, double width);

}  // namespace nodal::table
