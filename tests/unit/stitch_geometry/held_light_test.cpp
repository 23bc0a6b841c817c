#include "stitch/geometry/held_light.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace nodal::geometry {
namespace {

HeadCalibration dim_head() {
  HeadCalibration head;
  head.name = "a";
  head.width = head.height = 100;
  head.center_x = head.center_y = 50;
  head.lens = EquidistantLens{{40}};
  head.region = {0, 0, 100, 100, {}, {}};
  head.vignetting = {50, 50, 50, {}};
  return head;
}

/// The least light that is left from the centre to a corner, which is at 1.414 radii.
double darkest(const HeadCalibration& head) {
  const auto& v = head.vignetting.coefficients;
  double least = 1;
  for (double s = 0; s <= 2; s += 1e-4) least = std::min(least, 1 + s * (v[0] + s * (v[1] + s * v[2])));
  return least;
}

TEST(HoldLight, AFallOffThatIsAllowed_StaysToTheBit) {
  HeadCalibration head = dim_head();
  head.vignetting.coefficients = {-0.3, 0.01, 0};
  ASSERT_TRUE(check_head(head)) << check_head(head).error().text();
  const HeadCalibration before = head;
  EXPECT_FALSE(hold_light(head));
  EXPECT_EQ(head.vignetting, before.vignetting);
}

TEST(HoldLight, AFallOffThatIsTooStrong_IsHeldAtTheLeastLightThatIsAllowed) {
  HeadCalibration head = dim_head();
  head.vignetting.coefficients = {-0.2, -0.2, 0};  // 1 - 0.2 2 - 0.2 4 = -0.2 in a corner
  ASSERT_FALSE(check_head(head));
  EXPECT_TRUE(hold_light(head));
  ASSERT_TRUE(check_head(head));
  EXPECT_NEAR(darkest(head), 0.01, 1e-4);
  EXPECT_DOUBLE_EQ(head.vignetting.coefficients[0], head.vignetting.coefficients[1]) << "the shape stays";
}

TEST(HoldLight, GainsBeyondTheirBounds_AreClampedAndTheFallOffStays) {
  HeadCalibration head = dim_head();
  head.gain = {1000, 1, 0.001};
  head.vignetting.coefficients = {-0.3, 0, 0};
  EXPECT_TRUE(hold_light(head));
  EXPECT_EQ(head.gain, (std::array<double, 3>{100, 1, 0.01}));
  EXPECT_EQ(head.vignetting.coefficients[0], -0.3);
}

TEST(HoldLight, AnotherFault_IsNotHidden) {
  HeadCalibration head = dim_head();
  head.vignetting.coefficients = {-2, 0, 0};
  head.width = 0;
  const auto before = head.vignetting;
  EXPECT_FALSE(hold_light(head));
  EXPECT_EQ(head.vignetting, before);
}

}  // namespace
}  // namespace nodal::geometry
