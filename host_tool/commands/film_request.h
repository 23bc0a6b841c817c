// From the words of `nodal stitch` to what a film is made of.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host_tool/commands/stitch_film.h"
#include "host_tool/film/film_plan.h"
#include "host_tool/input/picture_split.h"
#include "protocol/base/result.h"

namespace nodal::host {

struct SegmentRange {
  std::uint64_t first = 0, last = 0;
};
/// "3", or "0-9". Errors: kBadValue.
Result<SegmentRange> parse_segments(const std::string& text);

/// Whether the inputs are films only, without a calibration in front of them.
bool films_alone(const StitchArgs& args);

/// The inputs, with one file for each head: for heads whose film is in several files, or in a folder, a list of them in
/// `folder`, that of the film's parts. `rate`: of pictures. Errors: those of film::files_of_heads() and make_list().
Result<std::vector<std::string>> one_for_each_head(const film::Programs& programs, const StitchArgs& args, int rate,
                                                   const std::string& folder);

/// Every --offset. Errors: kBadValue.
Result<std::vector<film::HeadTime>> given_times(const FilmArgs& words);

/// What the films of all heads have. One film for several heads has a track for each, or their pictures side by side,
/// as `split` says. Errors: naming the film.
Result<std::vector<film::FilmFile>> probe_films(const film::Programs& programs, const film::FilmRequest& request,
                                                const PictureSplit& split);
/// The same; without a track for each head, their pictures are side by side if the heads' sizes say so. Errors: those,
/// and kHeadMismatch for a film whose pictures are not of the head's size.
Result<std::vector<film::FilmFile>> probe_films(const film::Programs& programs, const film::FilmRequest& request);

/// `found`: a calibration that was found in the films; else the first input is one. notes: whole sentences for the
/// user.
/// Errors: with the option or the file that is wrong.
Result<film::FilmRequest> make_request(Console& console, const StitchArgs& args, const FilmArgs& words,
                                       const std::optional<Calibration>& found, std::vector<std::string>& notes);

}  // namespace nodal::host
