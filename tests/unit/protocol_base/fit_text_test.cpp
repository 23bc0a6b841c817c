#include "protocol/base/fit_text.h"

#include <gtest/gtest.h>

namespace nodal {
namespace {

TEST(Wrapped, LinesBreakAtSpacesAndCountCharactersNotBytes) {
  EXPECT_EQ(wrapped("", 5), std::vector<std::string>{});
  EXPECT_EQ(wrapped("one two three", 7), (std::vector<std::string>{"one two", "three"}));
  EXPECT_EQ(wrapped("µµµ µµµ", 7), std::vector<std::string>{"µµµ µµµ"});
  EXPECT_EQ(wrapped("a longer-than-wide b", 6), (std::vector<std::string>{"a", "longer-than-wide", "b"}));
}

TEST(WidthOf, EscapesHaveNoneAndCharactersOfSeveralBytesOne) {
  EXPECT_EQ(width_of("\x1b[31mred\x1b[0m µ°"), 6U);
  EXPECT_EQ(width_of(""), 0U);
}

TEST(Fitted, TextThatFits_StaysAsItIs) {
  for (const char* text : {"", "\n", "a", "a\n", "a\n\n  b  c\n", "12345678", "  a  b"})
    EXPECT_EQ(fitted(text, 8), text);
}

TEST(Fitted, WideLine_GoesOnIndentedByTwo) {
  EXPECT_EQ(fitted("one two three four", 10), "one two\n  three\n  four");
  EXPECT_EQ(fitted("  one two three\n", 10), "  one\n    two\n    three\n");
}

TEST(Fitted, WideLastColumn_GoesOnUnderItself) {
  EXPECT_EQ(fitted("  -x  one two three\nnext", 14), "  -x  one two\n      three\nnext");
  EXPECT_EQ(fitted("\x1b[31mred\x1b[0m  one two three", 12), "\x1b[31mred\x1b[0m  one two\n     three");
}

TEST(Fitted, AnyText_HasNoWiderLineUnlessAWordIs) {
  const std::string text =
      "raymaps  25 of 25 a second, 2048×1024; blend 3 ms, encode 4 ms\n    and  more   of it\nlast";
  for (std::size_t columns = 24; columns < 80; ++columns) {
    const std::string lines = fitted(text, columns);
    std::string words, before;
    for (const char c : lines) words += c == ' ' || c == '\n' ? "" : std::string(1, c);
    for (const char c : text) before += c == ' ' || c == '\n' ? "" : std::string(1, c);
    EXPECT_EQ(words, before);
    for (std::size_t at = 0; at < lines.size();) {
      const std::size_t end = std::min(lines.find('\n', at), lines.size());
      EXPECT_LE(width_of(std::string_view(lines).substr(at, end - at)), columns) << lines;
      at = end + 1;
    }
  }
}

}  // namespace
}  // namespace nodal
