// Where a rig is, as users write it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host {

inline constexpr std::string_view kDefaultRig = "unix:/run/nodal/nodal.sock";

struct RigAddress {
  std::string text;                  ///< as it was written, for messages
  std::vector<std::string> command;  ///< for ssh: what to start and talk to; else empty
  std::string link;                  ///< else: what hal's connect_link() takes
};

/// "unix:PATH" (a bare absolute path will do), "ssh://[user@]HOST[:port]".
/// `ssh_program` is what NODAL_SSH says, or "ssh".
/// Errors: kBadValue, which says what may be written.
Result<RigAddress> parse_rig_address(std::string_view text, std::string_view ssh_program);

}  // namespace nodal::host
