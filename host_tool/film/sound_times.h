// The heads' clocks from the sound of their films.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "host_tool/film/film_file.h"
#include "host_tool/film/film_plan.h"
#include "protocol/base/result.h"

namespace nodal::film {

/// Whether the clocks can be looked for in sound: the first head and all others without a given time have sound.
bool have_sound(const std::vector<FilmFile>& films, const std::vector<std::string>& heads,
                const std::vector<HeadTime>& given);

/// The heads' times against the first head's: those of `given` as they are, all others from sound. heads: their names,
/// one for each film. notes: one sentence for each head whose time was found. go_on: called with the part that is done,
/// 0 to 1; false stops.
/// Errors: kNotDetermined, with what to do, if a head's time is not certain; kBadFormat, naming the film, for sound
/// that cannot be decoded; kCancelled.
Result<std::vector<HeadTime>> times_by_sound(const Programs& programs, const std::vector<FilmFile>& films,
                                             const std::vector<std::string>& heads, const std::vector<HeadTime>& given,
                                             std::vector<std::string>& notes, const std::function<bool(double)>& go_on);

}  // namespace nodal::film
