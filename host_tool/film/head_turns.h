// How fast a head turns, by its film's pictures or by its gyro, and how bright its pictures are.
#pragma once

#include <functional>

#include "host_tool/film/film_file.h"
#include "host_tool/film/programs.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/timing/flash_lag.h"
#include "stitch/timing/rotation_lag.h"

namespace nodal::film {

/// What small pictures of a film tell. Times are seconds after the film's first frame.
struct SeenMotion {
  timing::Rotation rotation;
  timing::Brightness brightness;
};

/// Decodes the film to pictures of about 160 px: all of it up to kWholeSeconds, of a longer one that much, half from
/// the begin and half from the end. `readout_s`: seconds from the first to the last row's exposure; 0: not known.
/// go_on: called with the part that is done, 0 .. 1; false stops.
/// Errors: kBadFormat, naming the film; kCancelled.
Result<SeenMotion> motion_of(const Programs& programs, const FilmFile& film, const HeadCalibration& head,
                             double readout_s, const std::function<bool(double)>& go_on);
inline constexpr double kWholeSeconds = 1200;

/// The speed of rotation that the camera's gyro measured (GoPro's GPMF). film.gpmf: its track.
/// Errors: kBadFormat, kMissingField, naming the film.
Result<timing::Rotation> gyro_of(const Programs& programs, const FilmFile& film);

}  // namespace nodal::film
