#pragma once

#include <sys/socket.h>

#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace nodal::hal {

/// Where a socket is, read from what a user wrote.
struct SocketAddress {
  std::string text;  ///< as it was written
  std::string path;
  sockaddr_storage storage{};
  socklen_t size = 0;

  const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
};

/// kBadValue when it is not "unix:PATH".
Result<SocketAddress> parse_address(std::string_view text);

}  // namespace nodal::hal
