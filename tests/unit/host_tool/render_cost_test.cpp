// What a take's raymap costs is known before it is made.
#include "host_tool/commands/render_cost.h"

#include <gtest/gtest.h>

#include "tests/support/rigs.h"

namespace nodal::host {
namespace {

RaymapConfig raymap_of_width(int width) {
  RaymapConfig raymap;
  raymap.layout = "equirectangular";
  raymap.width = width;
  raymap.height = width / 2;
  return raymap;
}

RenderCost cost_of_width(int width) {
  const Calibration rig = test::ring(6, 640, 480);
  const auto cost = cost_of({&rig}, raymap_of_width(width), 1);
  EXPECT_TRUE(cost);
  return cost.value_or(RenderCost());
}

TEST(RenderCost, GrowsWithThePixels_WithoutCompilingThemAll) {
  const double narrow = static_cast<double>(cost_of_width(1024).bytes);
  const double wide = static_cast<double>(cost_of_width(16384).bytes);
  EXPECT_GT(wide / narrow, 100);
  EXPECT_LT(wide / narrow, 300) << "256 times the pixels";
}

TEST(RenderCost, MoreThanIsFree_IsRefusedWithAWidthThatFits) {
  const RaymapConfig raymap = raymap_of_width(16384);
  const RenderCost cost = cost_of_width(16384);
  EXPECT_TRUE(check_cost(cost, raymap, cost.bytes));
  const std::uint64_t free = cost.bytes / 5;
  const Status refused = check_cost(cost, raymap, free);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kTooLarge);
  const std::string& message = refused.error().message;
  const std::size_t at = message.find("--width ");
  ASSERT_NE(at, std::string::npos) << message;
  const int width = std::stoi(message.substr(at + 8));
  EXPECT_LE(cost_of_width(width).bytes, free) << message;
  EXPECT_GT(cost_of_width(width).bytes, free / 2) << message;
}

TEST(RenderCost, ACalibrationThatCannotBeCompiled_HasNone) {
  Calibration rig = test::ring(2, 640, 480);
  rig.heads.clear();
  EXPECT_FALSE(cost_of({&rig}, raymap_of_width(1024), 1));
}

}  // namespace
}  // namespace nodal::host
