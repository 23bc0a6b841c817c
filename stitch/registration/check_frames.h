// What is wrong with the frames, in one sentence that says what to try: no calibration that only looks fine.
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

/// Errors: kNoSignal for a black head, kHeadMismatch for one picture given to two heads.
Status check_light(const Calibration& prior, const std::vector<HeadPyramid>& pyramids);

/// Errors: kNoCoverage when fewer than two heads are left; `why_not` is empty for a head that is placed.
Status check_enough_placed(const Calibration& prior, const std::vector<std::string>& why_not);

/// Errors: kHeadMismatch when heads have detail where they overlap, and it is not the same.
Status check_agreement(const Calibration& prior, const Detail& detail, const std::vector<std::string>& why_not);

std::string nothing_shared(const Calibration& prior);

}  // namespace nodal::registration
