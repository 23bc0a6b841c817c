// A calibration for films that were given without one: found in their own frames.
#pragma once

#include <string>
#include <vector>

#include "host_tool/commands/stitch_job.h"
#include "host_tool/commands/stitch_pictures.h"
#include "host_tool/film/film_file.h"
#include "host_tool/film/film_plan.h"
#include "host_tool/input/picture_split.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// How the heads' pictures stand side by side in one film: as `choice` (--split) says, or two circles that a frame
/// shows.
/// folder: of the film's parts, where the frame is kept meanwhile. Errors: kMissingField if there is one picture only.
Result<PictureSplit> split_of_film(const film::Programs& programs, const film::FilmFile& film,
                                   const std::string& choice, const std::string& folder);

/// Looks for moments with detail and little motion, and makes of one of them what `nodal stitch` makes of pictures: a
/// still sphere beside the film, its calibration and its report. `names`: of the heads. `times`: the heads' times;
/// `timed`: false if they are not known, and only moments without motion will do. folder: of the film's parts, where
/// frames are kept meanwhile.
/// Errors: kNotDetermined, with what to do, if the rig always moves; kNoCoverage, naming the films that are not placed;
/// those of stitch_pictures().
Result<StitchedPictures> calibrate_films(Console& console, const StitchArgs& args, const film::Programs& programs,
                                         const std::vector<film::FilmFile>& films,
                                         const std::vector<std::string>& names,
                                         const std::vector<film::HeadTime>& times, bool timed,
                                         const std::string& folder);

}  // namespace nodal::host
