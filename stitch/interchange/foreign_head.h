// Common to the importers of other programs' lenses: a head from pairs of ray and pixel or from exact numbers, its
// region, and its max_angle.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/interchange/head_fit.h"
#include "stitch/interchange/import.h"

namespace nodal::interchange {

/// A head with its picture size, and with vignetting and region set for the whole picture; all else has default values.
HeadCalibration blank_head(const std::string& name, int width, int height);

/// If the lens ends or turns back inside the region, limits it to slightly less than that, with a note; then checks the
/// head. Errors: those of check_head.
Status finish_head(HeadCalibration& head, std::vector<std::string>& notes);

/// Sets lens, centre and aspect, and corrects the rotation by the one that the fit found; notes the residual.
void take_fit(const PolynomialHead& fit, const std::string& what_was_lost, HeadCalibration& head,
              std::vector<std::string>& notes);
/// Adds a note with the residual of a fitted lens, unless it is negligible.
void tell_lens_fit(double rms_px, double max_px, const std::string& what_was_lost, const HeadCalibration& head,
                   std::vector<std::string>& notes);

/// Sets the heads' positions (m, in the rig's frame), with a note that also says `how` they were found, and the
/// distance if there is one. Rounding errors are no positions; without any there is no distance.
void set_positions(std::span<const Eigen::Vector3d> positions, const std::string& how, ImportResult& result);

/// A picture's width or height from a field's value; `field` is its name in errors.
/// Errors: those of `value`; kBadValue outside 1..32768.
Result<int> picture_side(const Result<double>& value, const std::string& field);

/// Errors: kUnsupported if there is no head, or more than a rig may have.
Status check_head_count(std::size_t heads);
/// Errors: kTooLarge if a file has more than kMaxProjectBytes.
Status check_project_size(std::string_view text);

}  // namespace nodal::interchange
