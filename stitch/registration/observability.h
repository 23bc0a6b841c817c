// Observability: which heads share detail, how well it determines each of them, and the result's uncertainty.
#pragma once

#include <string>
#include <vector>

#include "stitch/registration/level.h"

namespace nodal::registration {

/// How one head's detail compares with the other heads'.
struct HeadDetail {
  double rms = 0;        ///< rms of its own detail in the overlaps, levels
  double agreement = 0;  ///< correlation with the other heads' detail: 1 the same, 0 nothing in common
  /// Standard deviation of its rotation about the worst axis, if all others are known; infinite if undetermined.
  double sigma_rad = 0;
  double shared_sr = 0;
};

/// Detail is the difference of two blurs. It is free of gain, fall-off and the slow gradients of a sky, which would let
/// a head move far at little cost.
struct Detail {
  std::vector<HeadDetail> heads;
  std::vector<PairSums> pairs;  ///< as Normal::pairs
};

/// Measures detail with the heads' current rotations, on the level `plan`; a middle level has little noise and is still
/// accurate. Heads whose `used` is false are ignored, so that their disagreement does not count against the others.
Result<Detail> measure_detail(const LevelPlan& plan, const std::vector<HeadPyramid>& pyramids,
                              const std::vector<HeadState>& heads, const std::vector<bool>& used,
                              const Options& options, const parallel::Workers& workers);

/// Which heads in `used` have less than a third of the median head's detail: they are out of focus, in fog, or in the
/// dark.
std::vector<bool> with_little_detail(const Detail& detail, const std::vector<bool>& used);

/// For each head, the spread (5th to 95th percentile) of the squared distance from the lens's centre over the rays that
/// it shares, where 1 is the head's edge; 0 if it shares none. If it is small, a fall-off cannot be distinguished from
/// a gain.
std::vector<double> fall_off_seen(const std::vector<HeadState>& heads);

/// A head with a smaller rms than this has no detail, levels.
inline constexpr double kDullRms = 0.5;

}  // namespace nodal::registration
