// From pictures to spheres, as `nodal stitch` makes them.
#pragma once

#include <string>
#include <vector>

#include "host_tool/commands/stitch_job.h"
#include "host_tool/console/console.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

/// What a run has to say at its end.
struct StitchedPictures {
  Calibration calibration;         ///< the one that was used, or found
  Json document;                   ///< the --json answer
  std::vector<std::string> lines;  ///< sentences that people read
};

/// Reads the pictures, finds their calibration unless it is given, and writes every sphere; a calibration that was
/// found and a report beside it. Shows a progress bar and the notes.
/// Errors: naming the file or the option, with what to do.
Result<StitchedPictures> stitch_pictures(Console& console, const StitchArgs& args);

}  // namespace nodal::host
