// A take that is named on the command line: a copy's folder, or its number on the rig.
#pragma once

#include <string>

#include "host_tool/commands/command.h"
#include "stitch/media/take/take_folder.h"

namespace nodal::host {

inline constexpr const char* kTakeArgumentHelp = "The folder of a copy, or the take's number on the rig";

/// A number that is also the name of a folder is the folder. Errors: those of TakeFolder and of the rig.
Result<media::TakeFolder> open_take(Context& context, const std::string& take);

}  // namespace nodal::host
