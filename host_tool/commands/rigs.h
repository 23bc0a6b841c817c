// What `rigs` does before the process gives up its rights: it reads the list of USB devices and runs avahi-browse.
#pragma once

#include "host_tool/commands/command.h"
#include "host_tool/rig/found_rigs.h"
#include "protocol/base/result.h"

namespace nodal::host {

inline constexpr const char* kRigsCommand = "rigs";

/// Sets `context.found_rigs`. Errors: kBadValue for --timeout.
Status prepare_rigs(Context& context);

}  // namespace nodal::host
