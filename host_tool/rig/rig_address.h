// The address of a rig, as users write it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host {

inline constexpr std::string_view kDefaultRig = "unix:/run/nodal/nodal.sock";
/// That one if it is there, else the socket of a rig that this user runs if it is there, else kDefaultRig.
std::string rig_of_this_machine();

struct RigAddress {
  std::string text;                  ///< as written by the user, for messages
  std::vector<std::string> command;  ///< the program to start and to communicate with (ssh); else empty
  std::string link;                  ///< unix:PATH or usb:[SERIAL], without a command
};

/// Accepts "unix:PATH" (or just an absolute path), "usb:" and "usb:SERIAL", and "ssh://[user@]HOST[:port]".
/// `ssh_program` is the value of NODAL_SSH, or "ssh".
/// Errors: kBadValue; the message gives the accepted forms.
Result<RigAddress> parse_rig_address(std::string_view text, std::string_view ssh_program);

}  // namespace nodal::host
