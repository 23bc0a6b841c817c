// The heads' own pictures from a take on this computer.
#pragma once

#include <string>

#include "host_tool/input/rig_pictures.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// Whether it is the folder of a take.
bool is_take(const std::string& path);

/// Up to `sets` sets of a take in which every head has a picture, evenly spread over the take; no calibration. Heads
/// are called as in the take.
/// Errors: those of media::TakeFolder; kNotFound when no set has all heads, naming the head that most sets lack.
Result<RigPictures> take_pictures(const std::string& folder, int sets);

}  // namespace nodal::host
