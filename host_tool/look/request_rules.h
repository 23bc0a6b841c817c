// Which requests the page's server answers. libmicrohttpd accepts more than a server on a desktop should.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace nodal::host::look {

/// A request as it came, with all of its headers in their order.
struct Asked {
  std::string method, path, version;
  std::vector<std::pair<std::string, std::string>> headers;
};

/// A request that is refused.
struct Refusal {
  unsigned status = 0;  ///< 0: the connection is closed without an answer
  std::string why;      ///< a sentence for people
};

/// A server in front of this one, such as nginx, which ends TLS and connects over a Unix socket that only it may open.
struct Front {
  std::vector<std::string> names;  ///< names and addresses that lead here, in lower case, without a port
  /// The front names here the address that the client connected to; its literal is a name of this server, too.
  static constexpr std::string_view kAddressHeader = "X-Server-Addr";
};

/// Who asks: a page of this program. Other pages in the same browser, and other users of this machine, do not know the
/// token; names of other machines that lead to 127.0.0.1 (DNS rebinding) have another Host.
struct Rules {
  std::uint16_t port = 0;
  std::string token;
  bool changes = false;          ///< POST is answered, too
  std::optional<Front> front{};  ///< if set: https behind it instead of http on 127.0.0.1, and no token

  static constexpr std::size_t kMaxBody = 64 << 10;  ///< bytes of a POST

  /// In this order: exactly one Host, 127.0.0.1, [::1] or localhost with the port, or a name of the front with any
  /// port, else 421; headers whose end another
  /// program could see elsewhere, a body, or a Transfer-Encoding, 400; a path that does not begin with the token, no
  /// answer; the Origin of another page, 403; a method other than GET and HEAD, 405. With `changes`, a POST needs one
  /// Content-Length of 1 to kMaxBody, else 400; the page's own Origin, else 403; JSON as its only Content-Type, else
  /// 415: forms of other pages have neither.
  std::optional<Refusal> check(const Asked& asked) const;
  /// The path after "/TOKEN/", of a request that was checked.
  std::string name(const Asked& asked) const { return asked.path.substr(front ? 1 : token.size() + 2); }
  /// "http://127.0.0.1:PORT/TOKEN/".
  std::string link() const;

 private:
  /// Whether Host names this server.
  bool is_own(const Asked& asked, const std::string& host) const;
};

/// The values of a header, in their order.
std::vector<std::string> values_of(const Asked& asked, std::string_view header);

}  // namespace nodal::host::look
