// What `nodal stitch` says of the sphere that it made.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "stitch_command.h"
#include "tests/support/terminal.h"

namespace nodal::command_line {
namespace {

/// The last line but one of what `nodal stitch` says.
std::string last_but_one(const std::string& text) {
  const std::size_t end = text.rfind('\n', text.rfind('\n') - 1);
  return text.substr(text.rfind('\n', end - 1) + 1, end - text.rfind('\n', end - 1) - 1);
}

TEST_F(StitchCommand, AHeadThatIsTurned_IsSaidInOneWordEverywhere) {
  write_pictures("pictures");
  const auto stitched = [&](const std::string& blend) {
    return nodal(
        {"stitch", path("rig.json"), path("pictures"), "--width", "512", "--blend", blend, "-o", path("s.jpg")});
  };
  EXPECT_EQ(last_but_one(stitched("board").out), "good: lines go on from picture to picture");
  Calibration turned = town().truth;
  // The first head looks forwards: 8 degrees to the right are 11 pixels of this sphere.
  const double c = std::cos(8 * std::numbers::pi / 180), s = std::sin(8 * std::numbers::pi / 180);
  turned.heads[0].R_head_rig = {c, 0, -s, 0, 1, 0, s, 0, c};
  write("rig.json", to_json(turned));
  const std::string said = last_but_one(stitched("board").out);
  EXPECT_TRUE(said.starts_with("look at the seam between '" + name_of(0) + "' and '")) << said;
  EXPECT_NE(said.find("at 3 other seams"), std::string::npos) << said << ": it has four neighbours";
  const std::string bent = last_but_one(stitched("best").out);
  EXPECT_NE(bent.find("lines were bent by up to 1"), std::string::npos) << bent << ": 10 to 19 px";
  const Json answer = nodal_json({"stitch", path("rig.json"), path("pictures"), "--width", "512", "--blend", "board",
                                  "-o", path("s.jpg")})
                          .at(0);
  EXPECT_EQ(answer["verdict"], "look");
  EXPECT_EQ(answer["seams"].size(), 12U) << "the edges of a cube";
  EXPECT_EQ(answer["seams"][0]["verdict"], "look") << "the worst one is first";
  EXPECT_EQ(answer["seams"][11]["verdict"], "good");
}

TEST_F(StitchCommand, Progress_IsOneBarInPercent) {
  write_pictures("pictures");
  const test::Shown shown = test::run_in_terminal(
      {NODAL_BIN_DIR "/nodal", "stitch", path("pictures"), "--width", "512", "--overwrite", "-o", path("s.jpg")},
      environment_);
  ASSERT_EQ(shown.code, 0) << shown.text;
  std::vector<int> percents;
  for (std::size_t at = 0; (at = shown.text.find("] ", at)) != std::string::npos; ++at)
    percents.push_back(std::atoi(shown.text.c_str() + at + 2));
  EXPECT_GE(percents.size(), 3U) << shown.text;
  EXPECT_TRUE(std::ranges::is_sorted(percents)) << "matching, registering and stitching share it";
  EXPECT_NE(shown.text.find(" %"), std::string::npos);
  EXPECT_EQ(shown.text.find("/10"), std::string::npos) << shown.text;
}

}  // namespace
}  // namespace nodal::command_line
