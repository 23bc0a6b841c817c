#pragma once

#include <sys/socket.h>

#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace nodal::hal {

/// The address of a socket, parsed from a user's text.
struct SocketAddress {
  std::string text;  ///< as written by the user
  std::string path;
  sockaddr_storage storage{};
  socklen_t size = 0;

  const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
};

/// kBadValue if it is not "unix:PATH".
Result<SocketAddress> parse_address(std::string_view text);

}  // namespace nodal::hal
