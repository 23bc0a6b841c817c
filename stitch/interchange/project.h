// The common part of both importers after the lines are read.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/interchange/import.h"
#include "stitch/interchange/panotools_script.h"

namespace nodal::interchange {

/// Four digits: enough for a note.
std::string short_number(double value);

/// The c lines of type t0. Images are counted from `first_image`; a pixel's centre is at integers in both
/// programs.
/// Errors: kBadValue for a point that names an image that is not there.
Status add_control_points(const std::vector<ScriptLine>& lines, int first_image, ImportResult& result);

/// Whether a file is a camera as OpenCV writes it.
bool is_opencv(std::string_view text);

}  // namespace nodal::interchange
