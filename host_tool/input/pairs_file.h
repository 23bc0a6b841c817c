// Point pairs in files, and those that cpfind finds.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/registration/pairs.h"

namespace nodal::host {

/// The pairs of a CSV file's text; blank lines, comments and the title line are passed over.
/// Errors: kBadFormat, kBadValue, each with its line: six fields, names of two heads of the rig, finite numbers.
Result<std::vector<registration::PointPair>> parse_pairs_csv(const std::string& text, const Calibration& rig);

/// CSV with the first line head_a,x_a,y_a,head_b,x_b,y_b: heads by name, pixels with centres at + 1/2. Or a Hugin or
/// PTGui project (.pto, .pts), of which the control points are taken, its images in the calibration's order.
/// Errors: those of reading; kBadFormat, kBadValue with the line; kHeadMismatch for a project of another rig.
Result<std::vector<registration::PointPair>> read_pairs(const std::string& file, const Calibration& rig);

std::string pairs_csv(const std::vector<registration::PointPair>& pairs, const Calibration& rig);

/// Drives Hugin's cpfind over one picture a head.
/// Errors: kNotFound when cpfind is not installed, kNotDetermined when it finds nothing.
Result<std::vector<registration::PointPair>> find_pairs(const std::vector<std::string>& pictures,
                                                        const Calibration& rig);

}  // namespace nodal::host
