// Observability: which heads share detail, how well it determines each of them, and the result's uncertainty.
#pragma once

#include <string>
#include <vector>

#include "stitch/registration/level.h"

namespace nodal::registration {

/// How one head's detail sits with the others'.
struct HeadDetail {
  double rms = 0;        ///< of its own detail where others see too, levels
  double agreement = 0;  ///< with the others' there: 1 the same, 0 nothing in common
  double sigma_rad = 0;  ///< of its rotation about the worst axis, all others known; infinite when undetermined
  double shared_sr = 0;
};

/// Detail is what lies between two blurs: free of gain, fall-off and of a sky's slow shades, which move a head anywhere
/// at little cost.
struct Detail {
  std::vector<HeadDetail> heads;
  std::vector<PairSums> pairs;  ///< as Normal::pairs
};

/// With the heads where they are now. `plan` says on which level; a middle one is quiet and still exact. Heads whose
/// `used` is false take no part: what they disagree by says nothing about the others.
Result<Detail> measure_detail(const LevelPlan& plan, const std::vector<HeadPyramid>& pyramids,
                              const std::vector<HeadState>& heads, const std::vector<bool>& used,
                              const Options& options, const Workers& workers);

/// Of each head, how far apart in its picture the rays lie that it shares: the spread (5th to 95th percentile) of the
/// distance from the lens's centre squared, 1 at the head's edge; 0 where it shares none. Where it is small a fall-off
/// cannot be told from a gain.
std::vector<double> fall_off_seen(const std::vector<HeadState>& heads);

/// Below this rms a head has no detail, levels.
inline constexpr double kDullRms = 0.5;

/// Standard deviations of what was sought.
struct Certainty {
  std::vector<double> rotation_rad;  ///< about the worst axis, against what holds the rig
  std::vector<double> log_focal;     ///< 0 where not sought
};
/// `gauge`: what the gauge makes of small changes of the heads' numbers (gauge.h); empty when the parameters hold it.
Certainty certainty_of(const Normal& normal, const Parameters& parameters, double pixels_a_sample,
                       const Eigen::MatrixXd& gauge);

}  // namespace nodal::registration
