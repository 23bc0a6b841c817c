#include "protocol/base/text.h"

#include <gtest/gtest.h>

namespace nodal {
namespace {

constexpr const char* kReplaced = "\xEF\xBF\xBD";

TEST(ValidUtf8, WellFormed_Unchanged) {
  // Characters of one, two, three and four bytes, and the limits of each: RFC 3629 section 3.
  for (const char* text : {"", "nodal", "\x7F", "\xC2\x80", "\xDF\xBF", "\xE0\xA0\x80", "\xED\x9F\xBF", "\xEE\x80\x80",
                           "\xEF\xBF\xBF", "\xF0\x90\x80\x80", "\xF4\x8F\xBF\xBF"}) {
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
  EXPECT_EQ(printable("\xC2\x9B"
                      "2J",
                      100),
            "?2J")
      << "the one-character form of ESC [";
  EXPECT_EQ(printable("gr\xC3\xBC\xC3\x9F", 100), "gr\xC3\xBC\xC3\x9F");
}

TEST(Printable, LineSeparatorsAndBidirectionalControls_AreReplaced) {
  // U+2028, U+2029; then every bidirectional control of UAX #9, table 3 and section 2.
  for (const char* hidden : {"\xE2\x80\xA8", "\xE2\x80\xA9", "\xD8\x9C", "\xE2\x80\x8E", "\xE2\x80\x8F", "\xE2\x80\xAA",
                             "\xE2\x80\xAB", "\xE2\x80\xAC", "\xE2\x80\xAD", "\xE2\x80\xAE", "\xE2\x81\xA6",
                             "\xE2\x81\xA7", "\xE2\x81\xA8", "\xE2\x81\xA9", "\xC2\x80", "\xC2\x9F"}) {
    EXPECT_EQ(printable(std::string("a") + hidden + "b", 100), "a?b");
    EXPECT_FALSE(is_printable(std::string("a") + hidden + "b"));
  }
}

TEST(Printable, CharactersBesideTheControls_AreShown) {
  // U+00A0, U+061B, U+061D, U+2010, U+2027, U+202F, U+2065 (unassigned), U+206A, U+1F600.
  for (const char* shown : {" ", "~", "\xC2\xA0", "\xD8\x9B", "\xD8\x9D", "\xE2\x80\x90", "\xE2\x80\xA7",
                            "\xE2\x80\xAF", "\xE2\x81\xA5", "\xE2\x81\xAA", "\xF0\x9F\x98\x80"}) {
    EXPECT_EQ(printable(shown, 100), shown);
    EXPECT_TRUE(is_printable(shown));
  }
  EXPECT_FALSE(is_printable("a\nb"));
  EXPECT_FALSE(is_printable("a\xFFz"));
}

TEST(Printable, TooLong_CutBetweenCharacters) {
  EXPECT_EQ(printable("abcdef", 3), "abc");
  EXPECT_EQ(printable("ab\xC3\xBC", 3), "ab");
  EXPECT_EQ(printable("ab\xC3\xBC", 4), "ab\xC3\xBC");
}

}  // namespace
}  // namespace nodal
