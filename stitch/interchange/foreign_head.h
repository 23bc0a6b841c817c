// The common part of the importers of other programs' lenses: a head from pixel pairs or exact numbers, its region, its
// end.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/interchange/head_fit.h"

namespace nodal::interchange {

/// A head whose picture, vignetting and region are set to the whole picture, all else as it stands.
HeadCalibration blank_head(const std::string& name, int width, int height);

/// Where a lens ends or turns back inside the region it is used up to a little before that, with a note; then
/// the head is checked. Errors: those of check_head.
Status finish_head(HeadCalibration& head, std::vector<std::string>& notes);

/// Sets lens, centre, aspect and, turned by what the fit turned, rotation; notes the residual.
void take_fit(const PolynomialHead& fit, const std::string& what_was_lost, HeadCalibration& head,
              std::vector<std::string>& notes);
/// A note with the residual of a fitted lens, unless it is negligible.
void tell_lens_fit(double rms_px, double max_px, const std::string& what_was_lost, const HeadCalibration& head,
                   std::vector<std::string>& notes);

/// A picture's width or height from what a field holds; `field` calls it in the error.
/// Errors: those of `value`; kBadValue outside 1..32768.
Result<int> picture_side(const Result<double>& value, const std::string& field);

/// Errors: kUnsupported when there are none or more than a rig has.
Status check_head_count(std::size_t heads);

}  // namespace nodal::interchange
