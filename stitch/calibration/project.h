// What both importers share once the lines are read.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/calibration/import.h"
#include "stitch/calibration/panotools_script.h"

namespace nodal::calibration {

/// Four digits: enough for a note.
std::string short_number(double value);

/// The c lines of type t0. Images are counted from `first_image`; a pixel's centre is at integers in both
/// programs.
/// Errors: kBadValue for a point that names an image that is not there.
Status add_control_points(const std::vector<ScriptLine>& lines, int first_image, ImportResult& result);

/// Whether a file is a camera as OpenCV writes it.
bool is_opencv(std::string_view text);

}  // namespace nodal::calibration
