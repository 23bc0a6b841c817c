// Brightness of heads over time: what is measured at some moments, for every frame.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "host_tool/film/light_plan.h"

namespace nodal::film {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

TEST(PlannedLight, BetweenMoments_ChangesEvenly) {
  const PlannedLight light = light_of({0, 100, 200, 300}, {{0, 0}, {0.1, -0.1}, {0.2, -0.2}, {0.3, -0.3}});
  ASSERT_EQ(light.stops.size(), 2u);
  EXPECT_EQ(light.at(0, 100), std::lround(0.1 * kStop));
  EXPECT_NEAR(light.at(0, 150), 0.15 * kStop, 1);
  EXPECT_NEAR(light.at(1, 150), -0.15 * kStop, 1);
  EXPECT_EQ(light.at(0, 300), light.at(0, 5000)) << "after the last moment nothing changes";
}

TEST(PlannedLight, OneMomentThatDiffersFromItsNeighbours_IsLeftOut) {
  const PlannedLight light =
      light_of({0, 10, 20, 30, 40}, {{0.5, -0.5}, {0.5, -0.5}, {2.5, -2.5}, {0.5, -0.5}, {0.5, -0.5}});
  for (std::uint64_t frame = 0; frame <= 40; ++frame) EXPECT_EQ(light.at(0, frame), kStop / 2) << frame;
  const PlannedLight first = light_of({0, 10, 20, 30}, {{2.5, 0}, {0.5, 0}, {0.5, 0}, {0.5, 0}});
  EXPECT_EQ(first.at(0, 0), kStop / 2) << "the first moment has neighbours on one side";
}

TEST(PlannedLight, MomentsThatAreNotKnown_AreTakenFromTheOthers) {
  const PlannedLight light =
      light_of({0, 10, 20, 30}, {{kUnknown, kUnknown}, {0.25, kUnknown}, {0.25, kUnknown}, {kUnknown, kUnknown}});
  EXPECT_EQ(light.at(0, 0), kStop / 4);
  EXPECT_EQ(light.at(0, 30), kStop / 4);
  EXPECT_EQ(light.at(1, 10), 0) << "a head that shares nothing keeps its brightness";
}

TEST(PlannedLight, DifferencesThatNobodySees_AreNone) {
  EXPECT_TRUE(light_of({0, 10}, {{0.03, -0.03}, {-0.03, 0.03}}).frames.empty());
  EXPECT_EQ(light_of({0, 10}, {{0.03, -0.03}, {-0.03, 0.03}}).at(0, 5), 0);
  EXPECT_FALSE(light_of({0, 10}, {{0.06, -0.06}, {0.06, -0.06}}).frames.empty());
}

}  // namespace
}  // namespace nodal::film
