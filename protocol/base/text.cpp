#include "protocol/base/text.h"

#include <cstdint>

namespace nodal {
namespace {

std::uint8_t byte_at(std::string_view text, std::size_t at) { return static_cast<std::uint8_t>(text[at]); }

/// Bytes of the well-formed character at the beginning of `text` (RFC 3629 section 4), or 0.
std::size_t character_bytes(std::string_view text) {
  const std::uint8_t first = byte_at(text, 0);
  if (first < 0x80) return 1;
  std::size_t n = 0;
  std::uint8_t low = 0x80, high = 0xBF;  // of the second byte
  if (first >= 0xC2 && first <= 0xDF) {
    n = 2;
  } else if (first >= 0xE0 && first <= 0xEF) {
    n = 3;
    if (first == 0xE0) low = 0xA0;   // shorter forms exist
    if (first == 0xED) high = 0x9F;  // surrogates
  } else if (first >= 0xF0 && first <= 0xF4) {
    n = 4;
    if (first == 0xF0) low = 0x90;
    if (first == 0xF4) high = 0x8F;  // beyond U+10FFFF
  }
  if (n == 0 || n > text.size()) return 0;
  if (byte_at(text, 1) < low || byte_at(text, 1) > high) return 0;
  for (std::size_t i = 2; i < n; ++i) {
    if ((byte_at(text, i) & 0xC0) != 0x80) return 0;
  }
  return n;
}

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";

}  // namespace

std::string valid_utf8(std::string_view text) {
  std::string clean;
  clean.reserve(text.size());
  while (!text.empty()) {
    const std::size_t n = character_bytes(text);
    clean += n > 0 ? text.substr(0, n) : kReplacement;
    text.remove_prefix(n > 0 ? n : 1);
  }
  return clean;
}

std::string printable(std::string_view text, std::size_t limit) {
  std::string clean;
  while (!text.empty()) {
    const std::size_t n = character_bytes(text);
    std::string_view next = n > 0 ? text.substr(0, n) : kReplacement;
    if (n == 1 && (byte_at(text, 0) < 0x20 || byte_at(text, 0) == 0x7F)) next = "?";
    if (n == 2 && byte_at(text, 0) == 0xC2 && byte_at(text, 1) < 0xA0) next = "?";  // C1: U+0080 to U+009F
    if (clean.size() + next.size() > limit) break;
    clean += next;
    text.remove_prefix(n > 0 ? n : 1);
  }
  return clean;
}

}  // namespace nodal
