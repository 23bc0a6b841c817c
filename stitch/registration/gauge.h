// The gauge: fixes the rotation of the whole rig, which overlaps do not determine, by the heads' mean or median.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "stitch/registration/head_state.h"
#include "stitch/registration/parameters.h"
#include "stitch/registration/registration.h"

namespace nodal::registration {

/// Turns the placed heads together, so that their turns away from `start` have mean zero (kMean), or geometric median
/// zero (kMost): then fewer than half of them may have moved anyhow, and the others' turns are zero all the same.
void hold_together(Gauge gauge, const std::vector<HeadState>& start, const std::vector<bool>& placed,
                   std::vector<HeadState>& heads);

/// What holding the mean does to small changes of the heads' numbers (rows as in Parameters::basis()): the mean of the
/// placed heads' turns is taken from each, the rest stays.
Eigen::MatrixXd mean_taken_out(const std::vector<HeadState>& heads, const std::vector<bool>& placed,
                               const Parameters& parameters);

}  // namespace nodal::registration
