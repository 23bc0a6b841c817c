// Truncated, hostile and foreign project files: each gives one clear error.
#include <gtest/gtest.h>

#include <string>

#include "stitch/interchange/import.h"

namespace nodal::interchange {
namespace {

struct BadProject {
  const char* name;
  std::string text;
  Errc code;
  std::vector<const char*> says;
  friend void PrintTo(const BadProject& bad, std::ostream* out) { *out << bad.name; }
};

const auto kByName = [](const auto& bad) { return std::string(bad.param.name); };

class ImportRefuses : public testing::TestWithParam<BadProject> {};

TEST_P(ImportRefuses, SayingWhereAndWhat) {
  const Result<ImportResult> import = import_project(GetParam().text, "rig");
  ASSERT_FALSE(import);
  EXPECT_EQ(import.error().code, GetParam().code) << import.error().text();
  for (const char* words : GetParam().says) {
    EXPECT_NE(import.error().message.find(words), std::string::npos)
        << words << " is not in: " << import.error().text();
  }
}

std::string many(const std::string& line, int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += line;
  return text;
}

INSTANTIATE_TEST_SUITE_P(
    Projects, ImportRefuses,
    testing::Values(
        BadProject{"Empty", "", Errc::kBadFormat, {"none of the files Nodal knows", "PTGui"}},
        BadProject{"NodalsOwn", R"({"nodal_calibration": 1})", Errc::kBadFormat, {"calibration of Nodal's already"}},
        BadProject{"Json", "{\"fileversion\": 50}", Errc::kBadFormat, {"newer ones save as JSON"}},
        BadProject{"HuginWithoutImages", "# hugin project file\np f2 w100 h50\n", Errc::kBadFormat, {"no image line"}},
        BadProject{"PtguiWithoutImages", "# ptGui project file\n", Errc::kBadFormat, {"no image"}},
        BadProject{"SixtyFiveImages", many("i w100 h100 f0 v60\n", 65), Errc::kUnsupported, {"65 images", "1 to 64"}},
        BadProject{"NoSize", "i f0 v60\n", Errc::kMissingField, {"line 1", "no w"}},
        BadProject{"NoFieldOfView", "# x\ni w100 h100 f0\n", Errc::kMissingField, {"line 2", "field of view"}},
        BadProject{"HugeSize", "i w1e9 h100 f0 v60\n", Errc::kBadValue, {"line 1", "w must be 1 to 32768"}},
        BadProject{"NaNSize", "i wnan h100 f0 v60\n", Errc::kMissingField, {"no w"}},
        BadProject{"WordForNumber", "i w100 h100 f0 v60 y=x\n", Errc::kBadValue, {"line 1", "'y'", "'x'"}},
        BadProject{"Overflow", "i w100 h100 f0 v60 y1e999\n", Errc::kBadValue, {"line 1", "'y'"}},
        BadProject{"PinholeOf180", "i w100 h100 f0 v180 n\"a\"\n", Errc::kBadValue, {"head 'a'", "180 degrees"}},
        BadProject{"NegativeView", "i w100 h100 f3 v-20 n\"a\"\n", Errc::kBadValue, {"head 'a'", "-20"}},
        BadProject{"Stereographic", "i w100 h100 f10 v100 n\"a\"\n", Errc::kUnsupported, {"head 'a'", "f10", "f0"}},
        BadProject{
            "FallingLens", "i w100 h100 f3 v100 a2 n\"a\"\n", Errc::kBadValue, {"head 'a'", "lens.coefficients[0]"}},
        BadProject{"TurnsAtOnce",
                   "i w100 h100 f3 v100 b4e4 c-4e4 n\"a\"\n",
                   Errc::kLensDomain,
                   {"head 'a'", "within a pixel"}},
        BadProject{"EmptyCrop", "i w100 h100 f3 v100 S50,20,0,100 n\"a\"\n", Errc::kBadValue, {"head 'a'", "region"}},
        BadProject{
            "CropOfThree", "i w100 h100 f3 v100 S50,20,0 n\"a\"\n", Errc::kBadValue, {"line 1", "'S'", "four numbers"}},
        BadProject{"LinkToNowhere", "i w100 h100 f0 v=4\n", Errc::kBadValue, {"line 1", "linked to image 4"}},
        BadProject{"LinkToItself", "i w100 h100 f0 v=0\n", Errc::kBadValue, {"line 1", "in a circle"}},
        BadProject{"ZeroVa", "i w100 h100 f0 v60 Va0\n", Errc::kBadValue, {"line 1", "Va"}},
        BadProject{"ExtremeExposure",
                   "i w100 h100 f0 v60 Eev-40 n\"a\"\ni w100 h100 f0 v60 n\"b\"\n",
                   Errc::kBadValue,
                   {"head 'a'", "gain.red"}},
        BadProject{"PointNowhere",
                   "i w100 h100 f0 v60\nc n0 N5 x1 y1 X1 Y1 t0\n",
                   Errc::kBadValue,
                   {"line 2", "image that is not there"}},
        BadProject{
            "PointWithoutX", "i w100 h100 f0 v60\nc n0 N0 y1 X1 Y1 t0\n", Errc::kMissingField, {"line 2", "no x"}},
        BadProject{"OpenQuote", "i w100 h100 f0 v60 n\"cam\n", Errc::kTruncated, {"line 1", "does not close"}},
        BadProject{"PtsCutBeforeItsImage", "#-imgfile 100 100 \"a.jpg\"\n", Errc::kTruncated, {"'a.jpg'"}},
        BadProject{"PtsWithoutSize", "# ptGui\no f0 v60\n", Errc::kMissingField, {"line 2", "#-imgfile"}},
        BadProject{"PtsBadSize", "#-imgfile x y \"a.jpg\"\no f0 v60\n", Errc::kBadFormat, {"line 1", "width, height"}},
        BadProject{"PtsBadCrop", "#-imgfile 100 100 \"a.jpg\"\no f0 v60 C9,3,1\n", Errc::kBadValue, {"line 2", "'C'"}},
        BadProject{"PtsCropOutside",
                   "#-imgfile 100 100 \"a.jpg\"\no f3 v60 C200,300,0,100\n",
                   Errc::kBadValue,
                   {"head 'a'", "region is empty"}},
        BadProject{"PtsCropInsideOut",
                   "#-imgfile 100 100 \"a.jpg\"\no f3 v60 C30,20,0,100\n",
                   Errc::kBadValue,
                   {"head 'a'", "crop"}}),
    kByName);

TEST(ImportErrors, TooManyBytes_AreNotRead) {
  EXPECT_EQ(import_project(std::string(kMaxProjectBytes + 1, '#'), "rig").error().code, Errc::kTooLarge);
}

TEST(ImportErrors, EveryPrefixOfAProject_GivesAResultOrAnError) {
  const std::string text =
      "# hugin project file\ni w1600 h1200 f2 v200 a0.03 b-0.06 c0.01 d5 e6 y77 p-13 r-45 Eev3 Va1 Vb-0.1 "
      "S210,1400,20,1190 n\"e.png\"\n"
      "i w1600 h1200 f2 v=0 a=0 b=0 c=0 d=0 e=0 y7 p13 r-45 n\"f.png\"\nc n0 N1 x1 y2 X3 Y4 t0\n";
  for (std::size_t length = 0; length <= text.size(); ++length) {
    const Result<ImportResult> import = import_project(text.substr(0, length), "rig");
    EXPECT_TRUE(import ? check_calibration(import->calibration).has_value() : !import.error().message.empty())
        << length;
  }
}

}  // namespace
}  // namespace nodal::interchange
