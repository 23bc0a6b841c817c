// From the heads' clocks to the frames that are shown together.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "host_tool/film/film_file.h"
#include "host_tool/film/film_plan.h"
#include "protocol/base/result.h"

namespace nodal::film {

/// The rate of a result: a usual one, if this is so near that it was measured, or rounded.
FrameRate usual_rate(FrameRate rate);

/// Seconds after the head's first frame at a time of the rig.
double head_seconds(const HeadTime& head, double rig_s);

/// The part of the rig's time in which every head films.
struct FilmSpan {
  double from_s = 0;         ///< the first instant, rig's time
  std::uint64_t frames = 0;  ///< instants, one period apart
  std::string ends_early;    ///< a sentence on the head that ends first, if others go on; empty: none
};
/// `times`: one per film. Errors: kBadValue, naming the two films, if there is none; kTooLarge.
Result<FilmSpan> common_span(const std::vector<FilmFile>& films, const std::vector<HeadTime>& times, double period_s);

/// The same, one period of `rate` apart. For a preview `rate` becomes one of which the span has kPreviewFrames frames
/// at most: every N-th. Errors: also kTooLarge for a rate that is too low.
Result<FilmSpan> chosen_span(const std::vector<FilmFile>& films, const std::vector<HeadTime>& times, bool preview,
                             FrameRate& rate);
inline constexpr std::uint64_t kPreviewFrames = 48;

/// The head's nearest frame for every instant. `farthest_s`: the largest distance.
std::vector<std::size_t> nearest_frames(const FilmFile& film, const HeadTime& time, const FilmSpan& span,
                                        double period_s, double* farthest_s);

}  // namespace nodal::film
