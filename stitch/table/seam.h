// Where one head ends and the next begins: the best head of a ray wins, with a linear ramp about the seam.
#pragma once

#include <Eigen/Core>
#include <span>

namespace nodal::table {

/// What one head has to offer for a ray.
struct SeamCandidate {
  double score = 0;  ///< > 0; the head with the largest one is the best
  /// Change of the score per radian along two orthogonal tangents of the sphere at the ray, the same for all heads.
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  double weight = 0;  ///< result, not yet scaled to a sum of 1
};

/// Computes the weights for seams of `width` radians, 0 or more.
///
/// The seam between two heads is where their scores a and b are equal. With their relative difference q = (a - b) /
/// (a + b), the distance of the worse one from the seam is q / |grad q| to first order, exactly so where both scores are
/// linear. Let x be that distance over width / 2, but at least q; the weight is (1 - x) / (1 + x), and 0 from x = 1 on.
/// That of the best head is 1. Between two heads, the smaller share is then (1 - x) / 2: a linear ramp from one half to
/// nothing, `width` wide on both sides together. Scores are 0 at the edge of a head's region, q is 1 there and the weight
/// 0, however wide the seam is: a seam wider than the overlap fills the overlap.
void apply_seam(std::span<SeamCandidate> candidates, double width);

}  // namespace nodal::table
