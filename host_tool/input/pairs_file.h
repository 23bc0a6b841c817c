// Reads point pairs from files, and finds them with cpfind.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/registration/pairs.h"

namespace nodal::host {

/// Point pairs that a file or project may have. A fit takes time and memory in proportion to them.
inline constexpr std::size_t kMaxPointPairs = 100'000;

/// Parses the pairs of a CSV text; blank lines, comments and the title line are skipped.
/// Errors: kBadFormat, kBadValue, with the line number: six fields, names of two heads of the rig, finite numbers.
Result<std::vector<registration::PointPair>> parse_pairs_csv(const std::string& text, const Calibration& rig);

/// Reads CSV with the first line head_a,x_a,y_a,head_b,x_b,y_b: heads by name, pixels with centres at + 1/2. Or a Hugin
/// or PTGui project (.pto, .pts): its control points, with its images in the calibration's order.
/// Errors: those of reading; kBadFormat, kBadValue with the line; kHeadMismatch for a project of another rig; kTooLarge
///   above kMaxPointPairs.
Result<std::vector<registration::PointPair>> read_pairs(const std::string& file, const Calibration& rig);

std::string pairs_csv(const std::vector<registration::PointPair>& pairs, const Calibration& rig);

/// Runs Hugin's cpfind on one picture per head.
/// Errors: kNotFound if cpfind is not installed, kNotDetermined if it finds nothing.
Result<std::vector<registration::PointPair>> find_pairs(const std::vector<std::string>& pictures,
                                                        const Calibration& rig);

}  // namespace nodal::host
