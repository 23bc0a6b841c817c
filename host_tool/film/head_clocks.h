// The heads' clocks from everything that their films tell: sound, gyro, pictures, and what their files say.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "host_tool/film/film_file.h"
#include "host_tool/film/film_plan.h"
#include "protocol/base/result.h"

namespace nodal::film {

/// What the clocks may be found in.
struct ClockSources {
  bool sound = true;
  bool gyro = true;
  bool rotation = true;  ///< rotation of the pictures is used
  bool flash = true;
  /// Whether the user named them. Otherwise pictures are decoded only where sound and gyro do not decide, and a result
  /// that is far from the times in the files is refused.
  bool named = false;
  double readout_s = 0;  ///< from the first to the last row's exposure, for flashes; 0: not known
};
/// "sound,gyro,rotation,flash" or a part of it. Errors: kBadValue.
Result<ClockSources> parse_clock_sources(const std::string& text);

struct HeadClocks {
  std::vector<HeadTime> times;  ///< one for each head
  double residual_s = 0;        ///< root mean square of how far the times of pairs differ from these; 0 without loops
};

/// The heads' times against the first head's: those of `given` as they are, all others from the sources, solved
/// together. scratch: a folder on a disk, for sounds. notes: whole sentences. go_on: called with what is done and the
/// part of it, 0 to 1; false stops.
/// Errors: kNotDetermined, with what to do, if a head's time is not certain; kBadFormat, naming the film, for what
/// cannot be decoded; kDiskFull; kCancelled.
Result<HeadClocks> find_clocks(const Programs& programs, const std::vector<FilmFile>& films,
                               const Calibration& calibration, const std::vector<HeadTime>& given,
                               const ClockSources& sources, const std::string& scratch, std::vector<std::string>& notes,
                               const std::function<bool(const std::string&, double)>& go_on);

}  // namespace nodal::film
