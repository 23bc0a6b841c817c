#include "protocol/files/user_folder.h"

#include <sys/un.h>

#include <cstdlib>

namespace nodal {

std::string user_rig_folder() {
  const auto absolute = [](const char* name) -> std::string {
    const char* const value = std::getenv(name);
    return value != nullptr && value[0] == '/' ? value : "";
  };
  if (const std::string state = absolute("XDG_STATE_HOME"); !state.empty()) return state + "/nodal";
  const std::string home = absolute("HOME");
  return home.empty() ? "" : home + "/.local/state/nodal";
}

std::string user_rig_socket() {
  const std::string folder = user_rig_folder();
  const std::string socket = folder + "/nodal.sock";
  return folder.empty() || socket.size() >= sizeof(sockaddr_un{}.sun_path) ? "" : socket;
}

}  // namespace nodal
