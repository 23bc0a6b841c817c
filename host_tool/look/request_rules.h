// Which requests the page's server answers. libmicrohttpd accepts more than a server on a desktop should.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
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

/// Who asks: a page of this program. Other pages in the same browser, and other users of this machine, do not know the
/// token; names of other machines that lead to 127.0.0.1 (DNS rebinding) have another Host.
struct Rules {
  std::uint16_t port = 0;
  std::string token;
  bool changes = false;  ///< POST is answered, too

  static constexpr std::size_t kMaxBody = 64 << 10;  ///< bytes of a POST

  /// In this order: exactly one Host, 127.0.0.1, [::1] or localhost with the port, else 421; headers whose end another
  /// program could see elsewhere, a body, or a Transfer-Encoding, 400; a path that does not begin with the token, no
  /// answer; the Origin of another page, 403; a method other than GET and HEAD, 405. With `changes`, a POST needs one
  /// Content-Length of 1 to kMaxBody, else 400; the page's own Origin, else 403; JSON as its only Content-Type, else
  /// 415: forms of other pages have neither.
  std::optional<Refusal> check(const Asked& asked) const;
  /// The path after "/TOKEN/", of a request that was checked.
  std::string name(const Asked& asked) const { return asked.path.substr(token.size() + 2); }
  /// "http://127.0.0.1:PORT/TOKEN/".
  std::string link() const;
};

}  // namespace nodal::host::look
