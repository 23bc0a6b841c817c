#pragma once

#include <string>

namespace nodal::daemon {

/// Joins standard input and output to the socket at `path` until either side ends; the exit code. So
/// `ssh rig nodald --bridge` is a link to the rig, with ssh's cryptography and none of ours.
int run_bridge(const std::string& path);

}  // namespace nodal::daemon
