// Where a rig keeps its files when an ordinary user runs it.
#pragma once

#include <string>

namespace nodal {

/// "$XDG_STATE_HOME/nodal", else "$HOME/.local/state/nodal"; empty if neither is an absolute path.
std::string user_rig_folder();
/// The control socket in that folder; empty if there is no such folder, or if a socket's path may not be so long.
std::string user_rig_socket();

}  // namespace nodal
