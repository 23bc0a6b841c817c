#include "host_tool/look/request_rules.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <string_view>

namespace nodal::host::look {
namespace {

bool same_word(std::string_view a, std::string_view b) {
  return std::ranges::equal(a, b, [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

/// Characters of a header's name (RFC 9110, 5.6.2).
bool is_token(const std::string& name) {
  constexpr std::string_view kMarks = "!#$%&'*+-.^_`|~";
  return !name.empty() && std::ranges::all_of(name, [&](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || kMarks.find(c) != std::string_view::npos;
  });
}

bool has_controls(const std::string& value) {
  return std::ranges::any_of(value, [](unsigned char c) { return (c < 0x20 && c != '\t') || c == 0x7F; });
}

bool is_body_length(const std::string& text) {
  std::size_t length = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), length);
  return error == std::errc() && end == text.data() + text.size() && length > 0 && length <= Rules::kMaxBody;
}

/// Takes as long for every path of the same length, so that time does not tell how many digits were right.
bool begins_with_token(const std::string& path, const std::string& token) {
  const std::string begins = "/" + token + "/";
  if (token.empty() || path.size() < begins.size()) return false;
  unsigned differences = 0;
  for (std::size_t k = 0; k < begins.size(); ++k)
    differences |= static_cast<unsigned>(static_cast<unsigned char>(path[k]) ^ static_cast<unsigned char>(begins[k]));
  return differences == 0;
}

/// The host without its port; nothing when the port is no number.
std::optional<std::string> without_port(const std::string& host) {
  const std::size_t colon = host.find(':', host.starts_with('[') ? host.find(']') : 0);
  if (colon == std::string::npos) return host;
  const std::string_view port = std::string_view(host).substr(colon + 1);
  constexpr std::size_t kMaxDigits = 5;
  const bool digits = std::ranges::all_of(port, [](char c) { return c >= '0' && c <= '9'; });
  if (port.empty() || port.size() > kMaxDigits || !digits) return std::nullopt;
  return host.substr(0, colon);
}

}  // namespace

std::vector<std::string> values_of(const Asked& asked, std::string_view header) {
  std::vector<std::string> values;
  for (const auto& [name, value] : asked.headers) {
    if (same_word(name, header)) values.push_back(value);
  }
  return values;
}

bool Rules::is_own(const Asked& asked, const std::string& host) const {
  if (!front) {
    const std::string end = fmt::format(":{}", port);
    const std::array hosts{"127.0.0.1" + end, "[::1]" + end, "localhost" + end};
    return std::ranges::any_of(hosts, [&](const std::string& own) { return same_word(own, host); });
  }
  const std::optional<std::string> name = without_port(host);
  if (!name) return false;
  const std::vector<std::string> address = values_of(asked, Front::kAddressHeader);
  if (address.size() == 1 && (address.front() == *name || "[" + address.front() + "]" == *name)) return true;
  return std::ranges::any_of(front->names, [&](const std::string& own) { return same_word(own, *name); });
}

std::string Rules::link() const { return fmt::format("http://127.0.0.1:{}/{}/", port, token); }

std::optional<Refusal> Rules::check(const Asked& asked) const {
  const std::vector<std::string> named = values_of(asked, "Host");
  if (named.size() != 1 || !is_own(asked, named.front())) {
    return Refusal{421, front ? "This is no name or address of this rig."
                              : "This server is for 127.0.0.1 and localhost on its own port only."};
  }
  for (const auto& [name, value] : asked.headers) {
    if (!is_token(name) || has_controls(value)) return Refusal{400, "A header is malformed."};
  }
  if (!values_of(asked, "Transfer-Encoding").empty()) return Refusal{400, "Transfer-Encoding is not accepted."};
  const bool post = changes && asked.method == "POST";
  const std::vector<std::string> lengths = values_of(asked, "Content-Length");
  if (post && (lengths.size() != 1 || !is_body_length(lengths.front())))
    return Refusal{400, "A POST here has one Content-Length, of at most 65536 bytes."};
  for (const std::string& length : lengths) {
    if (length != "0" && !post) return Refusal{400, "Requests have no body here."};
  }
  if (asked.version != "HTTP/1.1" && asked.version != "HTTP/1.0") return Refusal{400, "HTTP/1.1 is needed."};
  if (front ? !asked.path.starts_with('/') : !begins_with_token(asked.path, token)) return Refusal{0, ""};
  const std::vector<std::string> origins = values_of(asked, "Origin");
  if (post && origins.size() != 1) return Refusal{403, "Only this program's own page changes anything."};
  const std::string_view scheme = front ? "https://" : "http://";
  for (const std::string& origin : origins) {
    const bool right_scheme = origin.starts_with(scheme);
    const std::string from = right_scheme ? origin.substr(scheme.size()) : "";
    // Behind a front the page has the very name that its requests have.
    if (!right_scheme || (front ? !same_word(from, named.front()) : !is_own(asked, from)))
      return Refusal{403, "Pages of other sites are not answered."};
  }
  if (post) {
    const std::vector<std::string> types = values_of(asked, "Content-Type");
    if (types.size() != 1 || !same_word(types.front(), "application/json"))
      return Refusal{415, "Only JSON is read here."};
    return std::nullopt;
  }
  if (asked.method != "GET" && asked.method != "HEAD") return Refusal{405, "Only GET and HEAD are answered here."};
  return std::nullopt;
}

}  // namespace nodal::host::look
