// Requests to the page's server of `nodal look`.
#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <optional>
#include <string>

#include "tests/support/process.h"

namespace nodal::command_line {

/// What the server answers to a request, until it closes.
inline std::string answer_of(int port, const std::string& asked) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(port));
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::string came;
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0) {
    (void)!::send(fd, asked.data(), asked.size(), MSG_NOSIGNAL);
    std::array<char, 4096> piece{};
    for (ssize_t got = 1; (got = ::recv(fd, piece.data(), piece.size(), 0)) > 0;)
      came.append(piece.data(), static_cast<std::size_t>(got));
  }
  ::close(fd);
  return came;
}

inline std::string first_lines(const std::string& method, int port, const std::string& path) {
  return method + " " + path + " HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) + "\r\nConnection: close\r\n";
}

inline std::string get(int port, const std::string& path) {
  return answer_of(port, first_lines("GET", port, path) + "\r\n");
}

/// The link that a `nodal look` prints, in parts.
struct PageLink {
  int port = 0;
  std::string path;  ///< "/TOKEN/"

  static PageLink of(test::Process& look) {
    EXPECT_TRUE(test::wait_until([&] { return look.said().find("/\n") != std::string::npos; })) << look.complained();
    const std::string link = look.said().substr(0, look.said().find('\n')), begin = "http://127.0.0.1:";
    if (!link.starts_with(begin)) return {};
    return {std::stoi(link.substr(begin.size())), link.substr(link.find('/', begin.size()))};
  }
  std::string answer(const std::string& name) const { return get(port, path + name); }
  /// The answer to a POST of JSON; without an origin it is that of the page itself, with "" there is none.
  std::string post(const std::string& name, const std::string& json,
                   const std::optional<std::string>& origin = std::nullopt) const {
    const std::string from = origin.value_or("http://127.0.0.1:" + std::to_string(port));
    return answer_of(port, first_lines("POST", port, path + name) + (from.empty() ? "" : "Origin: " + from + "\r\n") +
                               "Content-Type: application/json\r\nContent-Length: " + std::to_string(json.size()) +
                               "\r\n\r\n" + json);
  }
  /// The answer without its headers.
  std::string body(const std::string& name) const {
    const std::string whole = answer(name);
    const std::size_t end = whole.find("\r\n\r\n");
    return end == std::string::npos ? "" : whole.substr(end + 4);
  }
};

}  // namespace nodal::command_line
