#include "stitch/interchange/panotools_script.h"

#include <gtest/gtest.h>

namespace nodal::interchange {
namespace {

std::vector<ScriptLine> parsed(std::string_view text) {
  Result<std::vector<ScriptLine>> lines = parse_script(text, 1 << 20);
  EXPECT_TRUE(lines) << (lines ? "" : lines.error().text());
  return lines ? *lines : std::vector<ScriptLine>();
}

TEST(PanotoolsScript, Line_FallsIntoVariables) {
  const auto lines = parsed("# hello\r\n\r\ni w780 h480 Ra0.5 v=0 a-1.5e-3 n\"my cam0.png\" C-21,1941,-441,1521\r\n");
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].comment, "# hello");
  const ScriptLine& line = lines[1];
  EXPECT_EQ(line.kind, 'i');
  EXPECT_EQ(line.number, 3);
  EXPECT_EQ(*line.find("w"), "780");
  EXPECT_EQ(*line.find("Ra"), "0.5");
  EXPECT_EQ(*line.find("v"), "=0");
  EXPECT_EQ(*line.find("n"), "my cam0.png");
  EXPECT_EQ(line.find("R"), nullptr);
  EXPECT_DOUBLE_EQ(*to_number(line, "a", *line.find("a")), -1.5e-3);
  EXPECT_EQ(*to_four_numbers(line, "C", *line.find("C")), (std::array<double, 4>{-21, 1941, -441, 1521}));
}

TEST(PanotoolsScript, OpenQuote_IsTruncatedAndSaysTheLine) {
  const auto lines = parse_script("i w1\ni n\"cam", 100);
  ASSERT_FALSE(lines);
  EXPECT_EQ(lines.error().code, Errc::kTruncated);
  EXPECT_NE(lines.error().message.find("line 2"), std::string::npos);
}

TEST(PanotoolsScript, TooLongOrNoText_IsRefused) {
  EXPECT_EQ(parse_script(std::string(101, 'i'), 100).error().code, Errc::kTooLarge);
  EXPECT_EQ(parse_script(std::string_view("i w\0", 4), 100).error().code, Errc::kBadFormat);
}

TEST(PanotoolsScript, Links_AreFollowedAcrossImages) {
  const auto lines = parsed("i v90 a1\ni v=0 a=0\ni v=1 a2\ni v=7 a=3\ni v=4\n");
  ImageLines images;
  for (const ScriptLine& line : lines) images.add(&line);
  EXPECT_EQ(*images.number_or(2, "v", 0), 90);
  EXPECT_EQ(*images.number_or(1, "a", 0), 1);
  EXPECT_EQ(*images.number_or(2, "a", 0), 2);
  EXPECT_EQ(*images.number_or(4, "a", -3), -3);
  EXPECT_NE(images.number_or(3, "v", 0).error().message.find("linked to image 7, and there are 5"), std::string::npos);
  EXPECT_NE(images.number_or(3, "a", 0).error().message.find("in a circle"), std::string::npos);
  EXPECT_NE(images.number_or(4, "v", 0).error().message.find("in a circle"), std::string::npos);
}

TEST(PanotoolsScript, NumberThatIsNone_IsNamed) {
  const auto lines = parsed("i vnan y1e999 p12x r");
  for (const char* name : {"y", "p", "r"}) {
    const Result<double> number = to_number(lines[0], name, *lines[0].find(name));
    ASSERT_FALSE(number) << name;
    EXPECT_EQ(number.error().code, Errc::kBadValue);
    EXPECT_NE(number.error().message.find(std::string("line 1: '") + name + "'"), std::string::npos)
        << number.error().text();
  }
  EXPECT_FALSE(to_number(lines[0], "v", "nan"));
  EXPECT_FALSE(to_number(lines[0], "v", "inf"));
  EXPECT_EQ(*to_number(lines[0], "v", "+3.5"), 3.5);
  EXPECT_FALSE(to_four_numbers(lines[0], "C", "1,2,3"));
  EXPECT_FALSE(to_four_numbers(lines[0], "C", "1,2,3,4,5"));
}

}  // namespace
}  // namespace nodal::interchange
