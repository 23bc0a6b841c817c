#include "protocol/base/text.h"

#include <cstdint>

namespace nodal {
namespace {

std::uint8_t byte_at(std::string_view text, std::size_t at) { return static_cast<std::uint8_t>(text[at]); }

/// Length in bytes of the well-formed character at the beginning of `text` (RFC 3629 section 4), or 0.
std::size_t character_bytes(std::string_view text) {
  const std::uint8_t first = byte_at(text, 0);
  if (first < 0x80) return 1;
  std::size_t n = 0;
  std::uint8_t low = 0x80, high = 0xBF;  // limits of the second byte
  if (first >= 0xC2 && first <= 0xDF) {
    n = 2;
  } else if (first >= 0xE0 && first <= 0xEF) {
    n = 3;
    if (first == 0xE0) low = 0xA0;   // excludes overlong forms
    if (first == 0xED) high = 0x9F;  // excludes surrogates
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

/// The code point of one well-formed character.
std::uint32_t decode(std::string_view character) {
  const std::uint8_t first = byte_at(character, 0);
  if (character.size() == 1) return first;
  std::uint32_t code = first & (0x7FU >> character.size());
  for (std::size_t i = 1; i < character.size(); ++i) code = code << 6 | (byte_at(character, i) & 0x3FU);
  return code;
}

bool is_control(std::uint32_t code) { return code < 0x20 || (code >= 0x7F && code <= 0x9F); }

bool is_separator(std::uint32_t code) { return code == 0x2028 || code == 0x2029; }

bool is_bidirectional_control(std::uint32_t code) {
  return code == 0x061C || code == 0x200E || code == 0x200F || (code >= 0x202A && code <= 0x202E) ||
         (code >= 0x2066 && code <= 0x2069);
}

bool may_be_shown(std::string_view character) {
  const std::uint32_t code = decode(character);
  return !is_control(code) && !is_separator(code) && !is_bidirectional_control(code);
}

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
    if (n > 0 && !may_be_shown(next)) next = "?";
    if (clean.size() + next.size() > limit) break;
    clean += next;
    text.remove_prefix(n > 0 ? n : 1);
  }
  return clean;
}

bool is_printable(std::string_view text) {
  while (!text.empty()) {
    const std::size_t n = character_bytes(text);
    if (n == 0 || !may_be_shown(text.substr(0, n))) return false;
    text.remove_prefix(n);
  }
  return true;
}

}  // namespace nodal
