// Moments of films in which a rig's heads can be calibrated: those with detail and little motion, and their frames as
// pictures.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "host_tool/film/film_file.h"
#include "host_tool/film/film_plan.h"
#include "protocol/base/result.h"

namespace nodal::film {

/// One instant of the rig's time.
struct Moment {
  std::vector<std::size_t> frames;  ///< the nearest frame of each head's film
  double detail = 0;                ///< mean difference of neighbouring pixels of small pictures, levels
  double motion = 0;                ///< the largest share of it that changes from one frame to the next
};

/// Up to kMoments instants, evenly from the time that all films have in common, the best one first: much detail, and
/// little motion. `times`: one a film. go_on: called with the part that is done, 0 .. 1; false stops.
/// Errors: kBadValue if the films have no time in common; kBadFormat, naming the film; kCancelled.
Result<std::vector<Moment>> still_moments(const Programs& programs, const std::vector<FilmFile>& films,
                                          const std::vector<HeadTime>& times, const std::function<bool(double)>& go_on);
inline constexpr int kMoments = 6;

/// A frame as a PNG file of 8 bits, with the pixels as they are coded, before they are rotated as the file says.
/// Errors: kBadFormat, naming the film.
Result<std::vector<std::uint8_t>> png_of(const Programs& programs, const FilmFile& film, std::size_t frame);

}  // namespace nodal::film
