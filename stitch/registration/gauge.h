// The gauge: fixes the rotation of the whole rig, which overlaps do not determine, by its first placed head, or by the
// heads' mean or median.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "stitch/registration/head_state.h"
#include "stitch/registration/parameters.h"
#include "stitch/registration/registration.h"

namespace nodal::registration {

/// Turns all placed heads together, so that the first one's turn relative to `start` is zero (kFirstHead), or their
/// turns have mean zero (kMean) or geometric median zero (kMedian). With the median, the turns of heads that did not
/// move are zero if fewer than half of the heads moved.
void hold_together(Gauge gauge, const std::vector<HeadState>& start, const std::vector<bool>& placed,
                   std::vector<HeadState>& heads);

/// The effect of the mean gauge on small changes of the heads' parameters (rows as in Parameters::basis()): subtracts
/// the mean of the placed heads' turns from each turn; other parameters are unchanged.
Eigen::MatrixXd mean_taken_out(const std::vector<HeadState>& heads, const std::vector<bool>& placed,
                               const Parameters& parameters);

}  // namespace nodal::registration
