// Links over Unix sockets, whose addresses are written "unix:/run/nodal.sock", over programs and over open descriptors.
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
  /// Permission bits, set exactly. Nothing: owner and group (0660), less what the umask takes away.
  std::optional<std::uint32_t> mode{};
  std::string group{};  ///< by name; empty: the process's
};

/// Listens at `address`. The listener removes the socket's file at its end; a file left by a program that died is
/// replaced, one that answers is kExists.
/// Errors: as connect_link, kExists, and kNotFound for a group that is not there.
Result<std::unique_ptr<LinkListenerPort>> listen_link(std::string_view address, const SocketFile& file = {});

/// Where a listener of listen_link() listens.
const std::string& listener_address(const LinkListenerPort& listener);

/// Starts a program and talks to its standard input and output, as with `ssh HOST nodal bridge`; its standard
/// error stays ours. The program is looked up in PATH. When the link is dropped the program's input ends; if
/// it has not ended of itself within a second it is terminated.
/// Errors: kNotFound when there is no such program, kIo. What the program's exit says comes as kLinkClosed.
Result<std::unique_ptr<LinkPort>> spawn_link(const std::vector<std::string>& command);

/// A link over open descriptors, such as 0 and 1 of a program that bridges. It closes them. Both
/// may be the same.
Result<std::unique_ptr<LinkPort>> descriptor_link(int read_from, int write_to, std::string peer);

/// What a thread that waits for the link should poll, beside the calls of LinkPort: the descriptors to read
/// from and write to, both the same for a socket.
struct LinkDescriptors {
  int read_from = -1;
  int write_to = -1;
};
/// The descriptors of a link made here; none of any other link.
LinkDescriptors link_descriptors(const LinkPort& link);
int listener_descriptor(const LinkListenerPort& listener);

}  // namespace nodal::hal
