// Heads that are placed by hand in the page of `nodal look`: only by mouse and keys.
#include <gtest/gtest.h>

#include <array>

#include "heads_page.h"

namespace nodal::command_line {
namespace {

TEST_F(HeadsPage, ADraggedHead_KeepsThePointUnderThePointer) {
  const std::vector<Json> seen = drive(write_rig(2, 2), {size_,
                                                         {"open"},
                                                         {"state"},
                                                         {"shot", "before.png", "page"},
                                                         {"heads"},
                                                         slide_,
                                                         {"press", "#head0"},
                                                         {"drag", 420, 300, 555, 251},
                                                         {"heads"},
                                                         {"shot", "after.png", "page"},
                                                         {"key", "ArrowLeft"},
                                                         {"heads"},
                                                         {"press", "#undo"},
                                                         {"press", "#undo"},
                                                         {"heads"},
                                                         {"axe"}});
  ASSERT_EQ(seen.size(), 7u);
  const Json &before = seen[2], &after = seen[3];
  const Eigen::Matrix3d turn = axes(after["heads"][0]) * axes(before["heads"][0]).transpose();
  const Eigen::Vector3d from = ray(seen[1], 420, 300), to = ray(seen[1], 555, 251);
  const double pixel = 2 * std::tan(seen[1]["fov"].get<double>() / 2 * kRadians) / seen[1]["width"].get<double>();
  EXPECT_LT((turn * from - to).norm(), pixel) << "within a pixel";
  EXPECT_EQ(after["heads"][1], before["heads"][1]) << "no other head moves";
  const Eigen::Matrix3d arrow = axes(seen[4]["heads"][0]) * axes(after["heads"][0]).transpose();
  EXPECT_TRUE(arrow.isApprox(Eigen::AngleAxisd(0.1 * kRadians, Eigen::Vector3d::UnitY()).toRotationMatrix(), 1e-9));
  EXPECT_EQ(seen[5]["heads"], before["heads"]) << "both are undone";
  EXPECT_EQ(seen[6], Json::array()) << "axe-core's violations";
}

TEST_F(HeadsPage, AMaskDrawnByClicks_IsInTheSavedCalibration) {
  const Json mask{"select", "tool", 5};
  const std::vector<Json> seen = drive(write_rig(0, 0), {size_,
                                                         {"open"},
                                                         {"state"},
                                                         mask,
                                                         {"click", 500, 400},
                                                         {"state"},
                                                         {"press", "#head0"},
                                                         {"click", 450, 350},
                                                         {"click", 550, 350},
                                                         {"click", 550, 450},
                                                         {"click", 450, 450},
                                                         {"shot", "open.png", "page"},
                                                         {"click", 452, 353},  // near the first corner
                                                         {"heads"},
                                                         {"shot", "mask.png", "page"},
                                                         {"press", "#save"},
                                                         {"until", "Saved as"},
                                                         {"axe"}});
  ASSERT_EQ(seen.size(), 5u);
  EXPECT_NE(seen[2]["message"].get<std::string>().find("Choose one head"), std::string::npos) << seen[2];
  ASSERT_EQ(seen[3]["heads"][0]["masks"].size(), 1u);
  const Json& outline = seen[3]["heads"][0]["masks"][0];
  const std::array<std::array<double, 2>, 4> corners{{{450, 350}, {550, 350}, {550, 450}, {450, 450}}};
  ASSERT_EQ(outline.size() % 4, 0u);
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector3d clicked = ray(seen[1], corners[k][0], corners[k][1]);
    const Json& is = outline[k * outline.size() / 4];
    EXPECT_LT((Eigen::Vector3d(is[0], is[1], is[2]) - clicked).norm(), 1e-4) << k;
  }
  EXPECT_EQ(seen[4], Json::array()) << "axe-core's violations";
  std::ifstream file(path("placed.json"));
  const Calibration placed =
      parse_calibration(std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>())).value();
  EXPECT_EQ(placed.heads[0].region.masks.size(), 1u);
  EXPECT_EQ(placed.heads[0].region.masks.at(0).size(), 4u);
}

TEST_F(HeadsPage, RegistrationAndSave_FindTheTruth) {
  // The upper right of the view forward is seen by the heads that look forward, right and up.
  const std::vector<Json> seen = drive(write_rig(2, 2), {size_,
                                                         {"open"},
                                                         {"select", "tool", 2},
                                                         {"click", 700, 200},
                                                         {"heads"},
                                                         {"click", 650, 420},
                                                         {"heads"},
                                                         {"shot", "pairs.png", "page"},
                                                         {"select", "mode", 2},
                                                         {"press", "#head1"},
                                                         {"shot", "difference.png", "page"},
                                                         {"press", "#register"},
                                                         {"until", "Registered"},
                                                         {"heads"},
                                                         {"shot", "registered.png", "page"},
                                                         {"press", "#save"},
                                                         {"until", "Saved as"},
                                                         {"size", 360, 640},
                                                         {"axe"},
                                                         {"state"},
                                                         {"shot", "360.png", "page"},
                                                         {"requests"}});
  ASSERT_EQ(seen.size(), 7u);
  const Json& done = seen[3];
  EXPECT_EQ(done["registered"]["error"], "");
  for (const Json& pair : done["pairs"]) EXPECT_LT(pair["residual_deg"].get<double>(), 0.2) << pair;
  const std::vector<std::uint8_t> bytes = test::read_bytes(path("placed.json"));
  const Calibration placed = parse_calibration(std::string(bytes.begin(), bytes.end())).value();
  EXPECT_LT(test::rotation_error(rig_.truth, placed).rms_deg, 0.01 * 130 / kSide);
  EXPECT_EQ(seen[4], Json::array());
  EXPECT_EQ(seen[5]["wider"], 0) << "nothing is beside a window of 360 px";
  for (const Json& url : seen[6]["requests"])
    EXPECT_TRUE(url.get<std::string>().starts_with("http://127.0.0.1:")) << url;
}

}  // namespace
}  // namespace nodal::command_line
