#pragma once

#include <sys/socket.h>

#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace nodal::hal {

/// Where a socket is, read from what a user wrote.
struct SocketAddress {
  std::string text;  ///< as it was written
  std::string path;  ///< of a Unix socket; empty for TCP
  sockaddr_storage storage{};
  socklen_t size = 0;

  bool is_unix() const { return !path.empty(); }
  const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
};

/// kBadValue when it cannot be read, or is TCP beyond this machine.
Result<SocketAddress> parse_address(std::string_view text);

/// "tcp:127.0.0.1:7700" of a bound socket.
std::string tcp_text(const sockaddr_storage& storage);

}  // namespace nodal::hal
