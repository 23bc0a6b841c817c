#include "hal/linux/link/address.h"

#include <fmt/format.h>

#include <sys/un.h>

#include <cstring>

namespace nodal::hal {
namespace {

tl::unexpected<Error> bad(std::string_view text, std::string_view why) {
  return fail(Errc::kBadValue, "address \"" + std::string(text) + "\": " + std::string(why));
}

}  // namespace

Result<SocketAddress> parse_address(std::string_view text) {
  constexpr std::string_view kUnix = "unix:";
  if (!text.starts_with(kUnix)) {
    return bad(text, "is not a Unix socket; write \"unix:/path/to/socket\", and reach other machines with ssh://HOST");
  }
  const std::string_view path = text.substr(kUnix.size());
  sockaddr_un where{};
  if (path.empty()) return bad(text, "a path is missing after \"unix:\"");
  if (path.find('\0') != std::string_view::npos) return bad(text, "a path cannot hold a zero byte");
  if (path.size() >= sizeof(where.sun_path)) {
    return bad(text, fmt::format("a Unix socket's path has at most {} bytes, this has {}", sizeof(where.sun_path) - 1,
                                 path.size()));
  }
  where.sun_family = AF_UNIX;
  std::memcpy(where.sun_path, path.data(), path.size());
  SocketAddress address{std::string(text), std::string(path), {}, sizeof(where)};
  std::memcpy(&address.storage, &where, sizeof(where));
  return address;
}

}  // namespace nodal::hal
