#include "protocol/base/text.h"

#include <gtest/gtest.h>

namespace nodal {
namespace {

constexpr const char* kReplaced = "\xEF\xBF\xBD";

TEST(ValidUtf8, WellFormed_Unchanged) {
  // One, two, three and four bytes, and the borders of each: RFC 3629 section 3.
  for (const char* text : {"", "nodal", "\x7F", "\xC2\x80", "\xDF\xBF", "\xE0\xA0\x80", "\xED\x9F\xBF",
                           "\xEE\x80\x80", "\xEF\xBF\xBF", "\xF0\x90\x80\x80", "\xF4\x8F\xBF\xBF"}) {
    EXPECT_EQ(valid_utf8(text), text);
  }
}

TEST(ValidUtf8, NotWellFormed_EachByteReplaced) {
  const auto times = [](int n) {
    std::string all;
    for (int i = 0; i < n; ++i) all += kReplaced;
    return all;
  };
  EXPECT_EQ(valid_utf8("a\x80z"), std::string("a\xEF\xBF\xBDz")) << "a byte that only goes on";
  EXPECT_EQ(valid_utf8("\xC3"), times(1)) << "cut off";
  EXPECT_EQ(valid_utf8("\xE2\x82"), times(2));
  EXPECT_EQ(valid_utf8("\xC3("), times(1) + "(");
  EXPECT_EQ(valid_utf8("\xC0\xAF"), times(2)) << "a longer form than needed";
  EXPECT_EQ(valid_utf8("\xE0\x80\xAF"), times(3));
  EXPECT_EQ(valid_utf8("\xED\xA0\x80"), times(3)) << "a surrogate";
  EXPECT_EQ(valid_utf8("\xF4\x90\x80\x80"), times(4)) << "beyond U+10FFFF";
  EXPECT_EQ(valid_utf8("\xFF\xFE"), times(2));
}

TEST(Printable, ControlCharacters_CannotMoveACursor) {
  EXPECT_EQ(printable("a\x1B[2Jb\r\n\x7F", 100), "a?[2Jb???");
  EXPECT_EQ(printable("\xC2\x9B" "2J", 100), "?2J") << "the one-character form of ESC [";
  EXPECT_EQ(printable("gr\xC3\xBC\xC3\x9F", 100), "gr\xC3\xBC\xC3\x9F");
}

TEST(Printable, TooLong_CutBetweenCharacters) {
  EXPECT_EQ(printable("abcdef", 3), "abc");
  EXPECT_EQ(printable("ab\xC3\xBC", 3), "ab");
  EXPECT_EQ(printable("ab\xC3\xBC", 4), "ab\xC3\xBC");
}

}  // namespace
}  // namespace nodal
