// Whether another calibration of the same pictures agrees with their points as well as the first one.
#pragma once

#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/autocalibration/matches.h"

namespace nodal::autocalibration {

/// By head: the median distance of its points from where the other heads' points say that they are, px; 0 for a head
/// with few points. Last: that of all points. Infinite where a head no longer sees them.
/// Errors: those of making the heads.
Result<std::vector<double>> point_errors(const Calibration& calibration, const std::vector<Match>& points);

/// Whether `after` is nowhere clearly worse than `before`; both of point_errors().
bool agrees_as_well(const std::vector<double>& before, const std::vector<double>& after);

}  // namespace nodal::autocalibration
