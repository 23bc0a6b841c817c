// The sound of a head's film, reduced for the comparison of clocks.
#pragma once

#include <functional>
#include <memory>

#include "host_tool/film/film_file.h"
#include "host_tool/film/programs.h"
#include "protocol/base/result.h"
#include "stitch/timing/sound_track.h"

namespace nodal::film {

/// Decodes the film's first sound track, in one channel, into the store. Times are seconds after the film's first
/// frame. go_on: false stops.
/// Errors: kBadFormat, naming the film; those of the store; kCancelled.
Result<timing::SoundTrack> track_of(const Programs& programs, const FilmFile& film,
                                    std::shared_ptr<timing::SoundStore> store, const std::function<bool()>& go_on);

}  // namespace nodal::film
