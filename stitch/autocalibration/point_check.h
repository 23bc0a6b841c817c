// Checks whether another calibration of the same pictures agrees with their points as well as the first one.
#pragma once

#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/autocalibration/matches.h"

namespace nodal::autocalibration {

/// For each head, the median distance between its points and where the other heads' points predict them, px; 0 for a
/// head with few points. The last number is that of all points. Infinite where a head no longer sees its points.
/// Errors: those of making the heads.
Result<std::vector<double>> point_errors(const Calibration& calibration, const std::vector<Match>& points);

/// Whether no number of `after` is clearly larger than that of `before`; both are results of point_errors().
bool agrees_as_well(const std::vector<double>& before, const std::vector<double>& after);

}  // namespace nodal::autocalibration
