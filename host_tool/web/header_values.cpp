#include "host_tool/web/header_values.h"

#include <algorithm>
#include <charconv>

namespace nodal::host::web {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

bool begins_with_word(std::string_view text, std::string_view word) {
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  return text.size() >= word.size() &&
         std::ranges::equal(text.substr(0, word.size()), word, [&](char a, char b) { return lower(a) == b; });
}

/// Digits and nothing else; a number beyond 64 bits is as good as the largest. Nothing if it is none.
std::optional<std::uint64_t> number_of(std::string_view text) {
  if (text.empty() || !std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; })) return std::nullopt;
  std::uint64_t value = 0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), value);
  return parsed.ec == std::errc() ? value : UINT64_MAX;
}

}  // namespace

bool is_hex(std::string_view text, std::size_t digits) {
  return text.size() == digits &&
         std::ranges::all_of(text, [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); });
}

std::optional<std::string> secret_of_cookie(std::string_view header, std::string_view name) {
  if (header.size() > kMaxCookieBytes) return std::nullopt;
  std::optional<std::string> found;
  while (!header.empty()) {
    const std::size_t end = std::min(header.find(';'), header.size());
    const std::string_view pair = trimmed(header.substr(0, end));
    header.remove_prefix(std::min(end + 1, header.size()));
    const std::size_t equals = pair.find('=');
    if (equals == std::string_view::npos || pair.substr(0, equals) != name) continue;
    const std::string_view value = pair.substr(equals + 1);
    if (found || !is_hex(value, kSecretDigits)) return std::nullopt;
    found = value;
  }
  return found;
}

std::optional<std::string> secret_of_bearer(std::string_view header) {
  constexpr std::string_view kScheme = "bearer ";
  if (!begins_with_word(header, kScheme)) return std::nullopt;
  const std::string_view secret = trimmed(header.substr(kScheme.size()));
  return is_hex(secret, kSecretDigits) ? std::optional(std::string(secret)) : std::nullopt;
}

ParsedRange parse_range(std::string_view header, std::uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  if (!begins_with_word(header, kUnit)) return {};
  const std::string_view range = trimmed(header.substr(kUnit.size()));
  const std::size_t dash = range.find('-');
  if (dash == std::string_view::npos) return {};
  const std::string_view first = range.substr(0, dash), last = range.substr(dash + 1);
  const auto to = number_of(last);
  if (first.empty()) {  // the last so many bytes
    if (!to) return {};
    const std::uint64_t length = std::min(*to, size);
    return length == 0 ? ParsedRange{RangeKind::kOutside} : ParsedRange{RangeKind::kPart, {size - length, length}};
  }
  const auto from = number_of(first);
  if (!from || (!last.empty() && !to) || (to && *to < *from)) return {};
  if (*from >= size) return {RangeKind::kOutside};
  const std::uint64_t most = size - *from;
  // The last byte is in the range; `to` may be the largest number that there is.
  const std::uint64_t length = to && *to - *from < most ? *to - *from + 1 : most;
  return {RangeKind::kPart, {*from, length}};
}

}  // namespace nodal::host::web
