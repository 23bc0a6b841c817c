// Every character that there is, and every beginning of bytes, against RFC 3629 and the Unicode standard.
#include <gtest/gtest.h>

#include <string>

#include "protocol/base/text.h"

namespace nodal {
namespace {

/// RFC 3629, section 3.
std::string encoded(std::uint32_t code) {
  const auto byte = [](std::uint32_t value) { return static_cast<char>(value); };
  const auto rest = [&](int shift) { return byte(0x80 + (code >> shift) % 0x40); };
  if (code < 0x80) return {byte(code)};
  if (code < 0x800) return {byte(0xC0 + (code >> 6)), rest(0)};
  if (code < 0x10000) return {byte(0xE0 + (code >> 12)), rest(6), rest(0)};
  return {byte(0xF0 + (code >> 18)), rest(12), rest(6), rest(0)};
}

/// Unicode 15: general categories Cc, Zl and Zp, and the characters with the property Bidi_Control.
bool harmful(std::uint32_t code) {
  const bool control = code <= 0x1F || code == 0x7F || (0x80 <= code && code <= 0x9F);
  const bool separator = code == 0x2028 || code == 0x2029;
  bool bidirectional = code == 0x061C || code == 0x200E || code == 0x200F;
  for (const std::uint32_t one : {0x202A, 0x202B, 0x202C, 0x202D, 0x202E, 0x2066, 0x2067, 0x2068, 0x2069}) {
    bidirectional = bidirectional || code == one;
  }
  return control || separator || bidirectional;
}

TEST(Characters, EachOfUnicode_IsShownUnlessItControlsTheTerminal) {
  for (std::uint32_t code = 0; code <= 0x10FFFF; ++code) {
    if (code == 0xD800) code = 0xE000;  // surrogates are no characters
    const std::string text = encoded(code);
    ASSERT_EQ(valid_utf8(text), text) << std::hex << code;
    ASSERT_EQ(is_printable(text), !harmful(code)) << std::hex << code;
    ASSERT_EQ(printable(text, 4), harmful(code) ? "?" : text) << std::hex << code;
  }
}

/// RFC 3629, section 4: the length of the character that begins with these two bytes, followed by 80 80; 0 for none.
std::size_t length_by_grammar(int first, int second) {
  const auto within = [](int value, int low, int high) { return low <= value && value <= high; };
  if (first <= 0x7F) return 1;
  if (within(first, 0xC2, 0xDF)) return within(second, 0x80, 0xBF) ? 2 : 0;
  if (first == 0xE0) return within(second, 0xA0, 0xBF) ? 3 : 0;
  if (within(first, 0xE1, 0xEC) || within(first, 0xEE, 0xEF)) return within(second, 0x80, 0xBF) ? 3 : 0;
  if (first == 0xED) return within(second, 0x80, 0x9F) ? 3 : 0;
  if (first == 0xF0) return within(second, 0x90, 0xBF) ? 4 : 0;
  if (within(first, 0xF1, 0xF3)) return within(second, 0x80, 0xBF) ? 4 : 0;
  if (first == 0xF4) return within(second, 0x80, 0x8F) ? 4 : 0;
  return 0;
}

TEST(Characters, EveryBeginning_IsACharacterExactlyWhenTheGrammarSaysSo) {
  for (int first = 0; first < 256; ++first) {
    for (int second = 0; second < 256; ++second) {
      const std::string text{static_cast<char>(first), static_cast<char>(second), '\x80', '\x80'};
      const std::size_t length = length_by_grammar(first, second);
      const std::string clean = valid_utf8(text);
      ASSERT_EQ(clean.starts_with("\xEF\xBF\xBD"), length == 0 || text.starts_with("\xEF\xBF\xBD"))
          << first << " " << second;
      ASSERT_TRUE(length == 0 || clean.starts_with(text.substr(0, length))) << first << " " << second;
      // Cut short, or with a last byte that continues nothing, it is no character.
      ASSERT_FALSE(length > 1 && is_printable(text.substr(0, length - 1))) << first << " " << second;
      ASSERT_FALSE(length > 2 && is_printable(text.substr(0, length - 1) + "\xC0")) << first << " " << second;
      ASSERT_FALSE(length > 2 && is_printable(text.substr(0, length - 1) + "A")) << first << " " << second;
    }
  }
}

TEST(Printable, ALimitWithinACharacter_EndsBeforeIt) {
  EXPECT_EQ(printable("a\xC3\xA9z", 2), "a");
  EXPECT_EQ(printable("a\xC3\xA9z", 3), "a\xC3\xA9");
  EXPECT_EQ(printable("a\xC3\xA9z", 4), "a\xC3\xA9z");
}

}  // namespace
}  // namespace nodal
