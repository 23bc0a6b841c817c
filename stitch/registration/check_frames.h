// Checks that detect unusable frames, with one sentence that says what to try, instead of a plausible but wrong result.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/registration/observability.h"
#include "stitch/registration/pyramid.h"
#include "stitch/registration/registration.h"

namespace nodal::registration {

/// Numbers and sizes. Errors: kBadValue, kUnsupported.
Status check_frames(const Calibration& prior, const std::vector<FrameSet>& frame_sets);

/// Errors: kNotDetermined for a black head, kHeadMismatch for one picture given to two heads.
Status check_light(const Calibration& prior, const std::vector<HeadPyramid>& pyramids);

/// Errors: kNoCoverage when fewer than two heads are left; `why_not` is empty for a head that is placed.
Status check_enough_placed(const Calibration& prior, const std::vector<std::string>& why_not);

/// Checks for heads whose detail differs from their neighbours' in the overlaps.
std::vector<std::size_t> disagreeing(const Detail& detail, const std::vector<std::string>& why_not);
/// Errors: kHeadMismatch when there are any.
Status check_agreement(const Calibration& prior, const std::vector<std::size_t>& wrong, std::size_t placed);

/// What is said of lenses that cannot have taken the pictures; `focals`: their focal lengths are what is wrong.
/// `promised`: the share of the differences that other lenses would take away.
std::string lens_misfit(bool focals, double promised);
std::string wrong_lenses(bool focals);
/// What is said of focal lengths that are wrong by so many percent, rms and mean: the heads differ by so many levels
/// with them held, and with them sought.
std::string wrong_focals(double rms_percent, double mean_percent, double held, double sought);

/// What is said of two placed heads whose fine detail does not line up.
std::string doubtful_seam(const std::string& a, const std::string& b);

std::string nothing_shared(const Calibration& prior);

}  // namespace nodal::registration
