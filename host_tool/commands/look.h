// What `look` prepares before the process gives up its rights: it needs a socket, and with --open a process that can
// start a browser.
#pragma once

#include <CLI/App.hpp>

#include "host_tool/commands/command.h"
#include "protocol/base/result.h"

namespace nodal::host {

inline constexpr const char* kLookCommand = "look";

/// Sets `context.page`. Errors: those of look::prepare().
Status prepare_look(Context& context, const CLI::App& command);

}  // namespace nodal::host
