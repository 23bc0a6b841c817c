#include "hal/linux/link/address.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/un.h>

#include <charconv>
#include <cstring>

namespace nodal::hal {
namespace {

constexpr std::string_view kHelp = "; write \"unix:/path/to/socket\" or \"tcp:127.0.0.1:PORT\"";

tl::unexpected<Error> bad(std::string_view text, std::string_view why) {
  return fail(Errc::kBadValue, "address \"" + std::string(text) + "\": " + std::string(why));
}

Result<SocketAddress> parse_unix(std::string_view text, std::string_view path) {
  sockaddr_un where{};
  if (path.empty()) return bad(text, "a path is missing after \"unix:\"");
  if (path.find('\0') != std::string_view::npos) return bad(text, "a path cannot hold a zero byte");
  if (path.size() >= sizeof(where.sun_path)) {
    return bad(text, "a Unix socket's path has at most " + std::to_string(sizeof(where.sun_path) - 1) +
                         " bytes, this has " + std::to_string(path.size()));
  }
  where.sun_family = AF_UNIX;
  std::memcpy(where.sun_path, path.data(), path.size());
  SocketAddress address{std::string(text), std::string(path), {}, sizeof(where)};
  std::memcpy(&address.storage, &where, sizeof(where));
  return address;
}

template <class T>
void store(SocketAddress& address, const T& where) {
  std::memcpy(&address.storage, &where, sizeof(where));
  address.size = sizeof(where);
}

Result<SocketAddress> parse_tcp(std::string_view text, std::string_view rest) {
  const std::size_t colon = rest.rfind(':');
  if (colon == std::string_view::npos) return bad(text, "a port is missing" + std::string(kHelp));
  const std::string_view port_text = rest.substr(colon + 1);
  std::uint16_t port = 0;
  const auto [end, problem] = std::from_chars(port_text.data(), port_text.data() + port_text.size(), port);
  if (problem != std::errc{} || end != port_text.data() + port_text.size()) {
    return bad(text, std::string(port_text) + " is no port; ports are 0 to 65535");
  }
  std::string host(rest.substr(0, colon));
  if (host == "localhost") host = "127.0.0.1";
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);

  SocketAddress address{std::string(text), {}, {}, 0};
  sockaddr_in v4{};
  sockaddr_in6 v6{};
  if (inet_pton(AF_INET, host.c_str(), &v4.sin_addr) == 1 && ntohl(v4.sin_addr.s_addr) >> 24 == 127) {
    v4.sin_family = AF_INET;
    v4.sin_port = htons(port);
    store(address, v4);
    return address;
  }
  if (inet_pton(AF_INET6, host.c_str(), &v6.sin6_addr) == 1 && IN6_IS_ADDR_LOOPBACK(&v6.sin6_addr)) {
    v6.sin6_family = AF_INET6;
    v6.sin6_port = htons(port);
    store(address, v6);
    return address;
  }
  return bad(text, host + " is not this machine's loopback (127.0.0.1, [::1], localhost): the protocol has "
                       "no cryptography of its own; reach other machines with ssh://HOST");
}

}  // namespace

Result<SocketAddress> parse_address(std::string_view text) {
  constexpr std::string_view kUnix = "unix:";
  constexpr std::string_view kTcp = "tcp:";
  if (text.starts_with(kUnix)) return parse_unix(text, text.substr(kUnix.size()));
  if (text.starts_with(kTcp)) return parse_tcp(text, text.substr(kTcp.size()));
  return bad(text, "neither a Unix nor a TCP socket" + std::string(kHelp));
}

std::string tcp_text(const sockaddr_storage& storage) {
  char host[INET6_ADDRSTRLEN] = "?";
  if (storage.ss_family == AF_INET6) {
    sockaddr_in6 v6;
    std::memcpy(&v6, &storage, sizeof(v6));
    inet_ntop(AF_INET6, &v6.sin6_addr, host, sizeof(host));
    return "tcp:[" + std::string(host) + "]:" + std::to_string(ntohs(v6.sin6_port));
  }
  sockaddr_in v4;
  std::memcpy(&v4, &storage, sizeof(v4));
  inet_ntop(AF_INET, &v4.sin_addr, host, sizeof(host));
  return "tcp:" + std::string(host) + ":" + std::to_string(ntohs(v4.sin_port));
}

}  // namespace nodal::hal
