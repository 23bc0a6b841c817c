#include "host_tool/rig/rig_address.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "protocol/files/user_folder.h"

namespace nodal::host {
namespace {

constexpr std::size_t kLongestSocketPath = 107;  // sockaddr_un's sun_path without its final zero

tl::unexpected<Error> bad(std::string_view text, std::string_view why) {
  return fail(Errc::kBadValue, fmt::format("rig address '{}': {}; write unix:PATH, usb:[SERIAL] or "
                                           "ssh://[USER@]HOST[:PORT]",
                                           text, why));
}

/// Whether `text` has only ASCII letters, digits and the characters of `others`. ssh(1) expands names in its
/// configuration (%h, %r) and may pass them to a shell (ProxyCommand, Match exec).
bool consists_of(std::string_view text, std::string_view others) {
  return std::ranges::all_of(text, [others](char c) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    return plain || others.find(c) != std::string_view::npos;
  });
}

std::optional<std::uint16_t> port_of(std::string_view text) {
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc() || end != text.data() + text.size() || port == 0) return std::nullopt;
  return port;
}

Result<RigAddress> parse_unix(std::string_view text, std::string_view path) {
  if (path.empty()) return bad(text, "the path of the socket is missing");
  if (path.size() > kLongestSocketPath) {
    return bad(text, fmt::format("a socket's path has at most {} bytes, this one {}", kLongestSocketPath, path.size()));
  }
  return RigAddress{std::string(text), {}, "unix:" + std::string(path)};
}

Result<RigAddress> parse_ssh(std::string_view text, std::string_view place, std::string_view ssh_program) {
  if (place.ends_with('/')) place.remove_suffix(1);
  std::string_view user;
  if (const std::size_t at = place.find('@'); at != std::string_view::npos) {
    user = place.substr(0, at);
    place.remove_prefix(at + 1);
    if (user.empty()) return bad(text, "the user before @ is missing");
  }
  std::string_view host = place;
  std::string_view port;
  const bool bracketed = place.starts_with('[');
  if (bracketed) {  // IPv6
    const std::size_t bracket = place.find(']');
    if (bracket == std::string_view::npos) return bad(text, "']' is missing");
    host = place.substr(1, bracket - 1);
    const std::string_view rest = place.substr(bracket + 1);
    if (!rest.empty() && !rest.starts_with(':')) return bad(text, "only :PORT may follow ']'");
    if (!rest.empty() && rest.size() == 1) return bad(text, "the port after : is missing");
    port = rest.empty() ? rest : rest.substr(1);
  } else if (const std::size_t colon = place.find(':'); colon != std::string_view::npos) {
    host = place.substr(0, colon);
    port = place.substr(colon + 1);
    if (port.empty()) return bad(text, "the port after : is missing");
  }
  if (host.empty()) return bad(text, "the host is missing");
  // ssh would interpret "-oProxyCommand=..." as an option.
  if (host.starts_with('-') || user.starts_with('-')) return bad(text, "a host or user does not begin with '-'");
  if (!consists_of(user, "._-+")) return bad(text, "a user has only letters, digits and . _ - +");
  if (!consists_of(host, bracketed ? ".:%_-" : "._-")) {
    return bad(text, bracketed ? "an IPv6 address has only hexadecimal digits, : and ., and % before its interface"
                               : "a host has only letters, digits and . _ -");
  }
  if (!port.empty() && !port_of(port)) return bad(text, "the port is not 1 to 65535");

  RigAddress address{std::string(text), {std::string(ssh_program), "-T"}, {}};
  if (!port.empty()) address.command.insert(address.command.end(), {"-p", std::string(port)});
  address.command.push_back(user.empty() ? std::string(host) : fmt::format("{}@{}", user, host));
  address.command.insert(address.command.end(), {"nodald", "--bridge"});
  return address;
}

}  // namespace

Result<RigAddress> parse_rig_address(std::string_view text, std::string_view ssh_program) {
  const auto after = [&](std::string_view prefix) { return text.substr(prefix.size()); };
  if (text.starts_with("unix:")) return parse_unix(text, after("unix:"));
  if (text.starts_with('/')) return parse_unix(text, text);
  if (text.starts_with("tcp:")) {
    return bad(text, "TCP is not served, since any user of the machine could connect; use the Unix socket or ssh://");
  }
  if (text.starts_with("usb:")) return RigAddress{std::string(text), {}, std::string(text)};
  if (text.starts_with("ssh://")) return parse_ssh(text, after("ssh://"), ssh_program);
  return bad(text, text.empty() ? "it is empty" : "this kind of link does not exist");
}

std::string rig_of_this_machine() {
  const auto is_there = [](const std::string& socket) {
    std::error_code error;
    return std::filesystem::is_socket(socket, error);
  };
  const std::string usual(kDefaultRig), own = user_rig_socket();
  return is_there(usual.substr(std::string_view("unix:").size())) || own.empty() || !is_there(own) ? usual
                                                                                                   : "unix:" + own;
}

}  // namespace nodal::host
