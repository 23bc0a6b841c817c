// Links over Unix sockets (addresses such as "unix:/run/nodal.sock"), over programs and over open descriptors.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hal/link.h"
#include "protocol/base/result.h"

namespace nodal::hal {

/// Connects to a rig that listens at `address`.
/// Errors: kBadValue (not an address), kUnreachable (no listener), kIo.
Result<std::unique_ptr<LinkPort>> connect_link(std::string_view address);

/// Which users may connect to a Unix socket: mode and group of its file.
struct SocketFile {
  /// Permission bits, set exactly. Nothing: owner and group (0660), reduced by the umask.
  std::optional<std::uint32_t> mode{};
  std::string group{};  ///< by name; empty: the process's group
};

/// Listens at `address`. The listener's destructor removes the socket's file. A file left by a program that died is
/// replaced; if a listener answers, the result is kExists.
/// Errors: as connect_link, kExists, and kNotFound for an unknown group.
Result<std::unique_ptr<LinkListenerPort>> listen_link(std::string_view address, const SocketFile& file = {});

/// The address of a listener made by listen_link().
const std::string& listener_address(const LinkListenerPort& listener);

/// Starts a program and communicates through its standard input and output, as with `ssh HOST nodal bridge`; its
/// standard error is inherited. The program is looked up in PATH. Destroying the link closes the program's input; if
/// the program has not ended a second later, it is terminated.
/// Errors: kNotFound if there is no such program, kIo. The program's exit status is reported as kLinkClosed.
Result<std::unique_ptr<LinkPort>> spawn_link(const std::vector<std::string>& command);

/// A link over open descriptors, such as 0 and 1 of a bridge program; it closes them. Both may be the
/// same.
Result<std::unique_ptr<LinkPort>> descriptor_link(int read_from, int write_to, std::string peer);

}  // namespace nodal::hal
