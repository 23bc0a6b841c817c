#pragma once

#include <string>

namespace nodal::daemon {

/// Connects standard input and output to the socket at `path` until either side ends. Returns the exit code.
/// `ssh rig nodald --bridge` is a link to the rig, so nodald needs no cryptography of its own.
int run_bridge(const std::string& path);

}  // namespace nodal::daemon
