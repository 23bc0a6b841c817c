// The bundle adjustment of rotations and lenses: one lens that all heads share, on request with small differences.
#pragma once

#include <array>
#include <vector>

#include "stitch/autocalibration/arrangement.h"
#include "stitch/autocalibration/unit_lens.h"

namespace nodal::autocalibration {

/// A match's two points in units of radius, from Shape::center().
struct UnitMatch {
  std::size_t a = 0, b = 0;
  Eigen::Vector2d at_a, at_b;
  double spread = 1;  ///< standard deviation relative to that of the most accurate features
};
std::vector<UnitMatch> in_units(const std::vector<Shape>& shapes, const std::vector<Match>& matches);

struct BundleState {
  SharedLens lens;
  std::vector<std::optional<Eigen::Matrix3d>> R_head_rig;
  std::vector<LensDifference> own{};  ///< by head; empty: all lenses are equal

  SharedLens lens_of(std::size_t head) const;
};

/// The distance, units of radius, of a match's points from where the other head's point says that they are (rms of
/// both), divided by the match's spread; infinite if a head is not placed or a lens does not reach that far.
std::vector<double> errors_of(const BundleState& state, const std::vector<UnitMatch>& matches);

struct BundleFit {
  BundleState state;
  std::vector<double> errors;                            ///< by match, see errors_of()
  std::vector<bool> used;                                ///< by match
  double noise = 0;                                      ///< standard deviation of an error along x or y
  double error = 0;                                      ///< median of the used matches' errors
  double held = 0;                                       ///< cost of the lens's priors, squared standard deviations
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< covariance of log focal, k1 and k2 of the shared lens
};

struct BundleRules {
  SharedLens prior;               ///< what coefficients and aspect are expected to be near
  std::size_t first = 0;          ///< the head that keeps its rotation
  bool free_aspect = false;       ///< the pixels' aspect is estimated
  std::array<double, 2> sigma{};  ///< standard deviations of the lens's coefficients about those of `prior`
  double shift_sigma = 0;         ///< standard deviation of the lens's axis, units of radius
  double stated_focal = 0;        ///< focal length that the camera states, units of radius; 0: it does not say
  /// Standard deviation of a head's own log focal length and axis, units, around the shared ones; 0: no own ones.
  double own_sigma = 0;
};

/// Minimizes the distances in the picture with Huber's norm. Its scale begins wide and shrinks to the noise of the
/// matches that agree, so that outliers do not determine it. Matches of heads without a rotation are not used.
BundleFit adjust(BundleState start, const std::vector<UnitMatch>& matches, const BundleRules& rules);

}  // namespace nodal::autocalibration
