// The heads' own pictures from a take on this computer.
#pragma once

#include <string>

#include "host_tool/input/rig_pictures.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// Up to `sets` sets of a take in which every head has a picture, evenly spread over the take; no calibration. Heads
/// are called as in the take.
/// Errors: those of TakeHeads.
Result<RigPictures> take_pictures(const std::string& folder, int sets);

}  // namespace nodal::host
