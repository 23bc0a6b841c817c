// Parts that the importers share once the lines are parsed.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/interchange/import.h"
#include "stitch/interchange/panotools_script.h"

namespace nodal::interchange {

/// The number with four digits, for a note.
std::string short_number(double value);

/// Adds the c lines of type t0; in both programs pixel centres are at integers. Images are counted from `first_image`;
/// `head_of` is each one's head, or nothing for one that is switched off, whose points are left out.
/// Errors: kBadValue for a point that names a missing image.
Status add_control_points(const std::vector<ScriptLine>& lines, std::span<const std::optional<std::size_t>> head_of,
                          ImportResult& result, int first_image = 0);

}  // namespace nodal::interchange
