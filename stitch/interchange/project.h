// Parts that the importers share once the lines are parsed.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/interchange/import.h"
#include "stitch/interchange/panotools_script.h"

namespace nodal::interchange {

/// The number with four digits, for a note.
std::string short_number(double value);

/// Adds the c lines of type t0. Images are counted from `first_image`; in both programs pixel centres are at
/// integers.
/// Errors: kBadValue for a point that names a missing image.
Status add_control_points(const std::vector<ScriptLine>& lines, int first_image, ImportResult& result);

}  // namespace nodal::interchange
