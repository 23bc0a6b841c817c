// From the words of `nodal stitch` to what a film is made of.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "host_tool/commands/stitch_film.h"
#include "host_tool/film/film_plan.h"
#include "protocol/base/result.h"

namespace nodal::host {

struct SegmentRange {
  std::uint64_t first = 0, last = 0;
};
/// "3", or "0-9". Errors: kBadValue.
Result<SegmentRange> parse_segments(const std::string& text);

/// Reads the calibration. notes: whole sentences for the user.
/// Errors: with the option or the file that is wrong.
Result<film::FilmRequest> make_request(Console& console, const StitchArgs& args, const FilmArgs& words,
                                       std::vector<std::string>& notes);

}  // namespace nodal::host
