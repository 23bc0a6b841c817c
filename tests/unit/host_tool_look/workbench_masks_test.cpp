// Masks that are drawn on heads.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "workbench_fixture.h"

namespace nodal::host::look {
namespace {

TEST_F(Bench, AMask_CoversInItsHeadWhatTheDirectionsEnclose_AndIsSavedUndoneAndRemoved) {
  start(town().truth);
  const Eigen::Matrix3d R = axes(state()["heads"][2]);
  const double a = 12 * kDegree;
  // Around the head's axis: to the right, up, to the left, down.
  const std::vector<Eigen::Vector3d> corners{{std::sin(a), 0, -std::cos(a)},
                                             {0, std::sin(a), -std::cos(a)},
                                             {-std::sin(a), 0, -std::cos(a)},
                                             {0, -std::sin(a), -std::cos(a)}};
  Json points = Json::array();
  for (const Eigen::Vector3d& corner : corners) points.push_back(list(R * corner));
  const Json masked = parsed(change({{"do", "mask"}, {"head", 2}, {"points", points}}));
  ASSERT_EQ(masked["heads"][2]["masks"].size(), 1U);
  EXPECT_EQ(masked["heads"][3]["masks"].size(), 0U);
  const Json& outline = masked["heads"][2]["masks"][0];
  ASSERT_GT(outline.size(), 8U);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(outline[0][k].get<double>(), points[0][k].get<double>(), 1e-9);
  ASSERT_EQ(change({{"do", "save"}}).status, 200U);
  const Calibration saved_rig = parse_calibration(saved()).value();
  const auto& masks = saved_rig.heads[2].region.masks;
  ASSERT_EQ(masks.size(), 1U);
  ASSERT_EQ(masks[0].size(), 4U);
  const double middle = kSide / 2.0, off = kSide / kView * 12;  // px for 12 degrees of an equidistant lens
  const std::array<std::array<double, 2>, 4> expected{
      {{middle + off, middle}, {middle, middle - off}, {middle - off, middle}, {middle, middle + off}}};
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_NEAR(masks[0][k].x, expected[k][0], 0.01) << k;
    EXPECT_NEAR(masks[0][k].y, expected[k][1], 0.01) << k;
  }
  const Eigen::Vector3d axis = R * Eigen::Vector3d(0, 0, -1);
  const auto seen_by_two = [&] {
    const Json seen = parsed(bench_->answer(
        {"seen", {{"x", std::to_string(axis.x())}, {"y", std::to_string(axis.y())}, {"z", std::to_string(axis.z())}}}));
    return std::ranges::any_of(seen, [](const Json& one) { return one["head"] == 2; });
  };
  EXPECT_FALSE(seen_by_two()) << "what is masked is not used, for pairs neither";
  EXPECT_EQ(parsed(change({{"do", "undo"}}))["heads"][2]["masks"].size(), 0U);
  EXPECT_TRUE(seen_by_two());
  EXPECT_EQ(parsed(change({{"do", "redo"}}))["heads"][2]["masks"].size(), 1U);
  EXPECT_EQ(parsed(change({{"do", "unmask"}, {"head", 2}}))["heads"][2]["masks"].size(), 0U);

  const std::string before = state().dump();
  const Json two = {points[0], points[1]};
  Json behind = points;
  behind[1] = list(R * Eigen::Vector3d(0, 0, 1));
  Json many = Json::array();  // more corners than a calibration may have
  for (std::size_t k = 0; k < 300; ++k) {
    const double turn = static_cast<double>(k) / 300 * 360 * kDegree;
    many.push_back(list(R * Eigen::Vector3d(std::sin(a) * std::cos(turn), std::sin(a) * std::sin(turn), -std::cos(a))));
  }
  for (const Json& wrong : {two, behind, many, Json::array(), Json("x")}) {
    const Answer refused = change({{"do", "mask"}, {"head", 2}, {"points", wrong}});
    EXPECT_EQ(refused.status, 400U) << wrong;
    EXPECT_FALSE(refused.body->empty());
  }
  EXPECT_EQ(change({{"do", "mask"}, {"head", 6}, {"points", points}}).status, 400U);
  EXPECT_EQ(state().dump(), before);
}

}  // namespace
}  // namespace nodal::host::look
