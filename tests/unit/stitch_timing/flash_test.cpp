// Lags from flashes as rolling shutters record them.
#include <gtest/gtest.h>

#include <cmath>

#include "recordings.h"
#include "stitch/timing/flash_lag.h"

namespace nodal::timing {
namespace {

using recordings::Camera;
using recordings::Clock;

const std::vector<double> kFlashes{4.011, 9.753, 13.38, 21.3172, 25.0, 27.773};

Result<Lag> measured(const std::vector<double>& seen_a, const std::vector<double>& seen_b, Clock a, Clock b, int rows,
                     double readout) {
  const Camera camera_a{.rate = 30, .rows = rows, .readout = 0.016},
      camera_b{.rate = 25, .rows = rows, .readout = 0.02};
  auto bright_a = recordings::filmed(seen_a, a, camera_a, 30, 1),
       bright_b = recordings::filmed(seen_b, b, camera_b, 30, 2);
  if (readout == 0) bright_a.readout = bright_b.readout = 0;
  return flash_lag(bright_a, bright_b, {});
}

TEST(FlashLag, RowsAndReadout_LagIsTrueToHalfAMillisecond) {
  const Clock a{0.1, 50}, b{-2.2, -50};
  const auto lag = measured(kFlashes, kFlashes, a, b, 60, 1);
  ASSERT_TRUE(lag) << lag.error().text();
  EXPECT_EQ(lag->used, 6);
  for (const double at : {0.0, 15.0, 30.0}) {
    EXPECT_NEAR(lag->value(at), true_lag(a, b, at), 0.5e-3) << at;
    EXPECT_NEAR(lag->value(at), true_lag(a, b, at), 4 * lag->sigma(at)) << at;
  }
}

TEST(FlashLag, MeansOfFramesOnly_LagIsTrueToAFrameAndSaysSo) {
  const Clock a{0.1, 0}, b{-2.2, 0};
  const auto lag = measured(kFlashes, kFlashes, a, b, 1, 0);
  ASSERT_TRUE(lag) << lag.error().text();
  EXPECT_NEAR(lag->value(15), 2.3, 0.035);
  EXPECT_GT(lag->sigma(15), 3e-3);
}

TEST(FlashLag, FlashThatOneHeadDoesNotSee_IsPassedOver) {
  const auto lag = measured(kFlashes, {4.011, 13.38, 21.3172, 25.0}, {}, {1, 0}, 60, 1);
  ASSERT_TRUE(lag) << lag.error().text();
  EXPECT_EQ(lag->used, 4);
  EXPECT_NEAR(lag->value(10), -1, 0.5e-3);
}

TEST(FlashLag, SingleFlash_IsMarkedAsOne) {
  const auto lag = measured({7.77}, {7.77}, {}, {1, 0}, 60, 1);
  ASSERT_TRUE(lag) << lag.error().text();
  EXPECT_EQ(lag->used, 1);
}

TEST(FlashLag, EvenFlashesOrNone_AreRefused) {
  const auto none = measured({}, kFlashes, {}, {}, 60, 1);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message.find("no flash"), std::string::npos);
  const auto even = measured({5, 10, 15}, {10, 15, 20}, {}, {2.5, 0}, 60, 1);
  ASSERT_FALSE(even) << even->lag;
  const auto other = measured({5, 6, 8, 11}, {5, 9.5, 12.1, 13.3}, {}, {}, 60, 1);
  EXPECT_FALSE(other);
}

TEST(FlashLag, LightSwitchedOn_IsNoFlash) {
  auto bright = recordings::filmed({}, {}, {.rate = 30, .rows = 1, .readout = 0.016}, 10, 1);
  for (std::size_t i = 100; i < bright.luma.size(); ++i) bright.luma[i] += 60;
  EXPECT_TRUE(flashes_of(bright).empty());
}

TEST(FlashLag, NumbersThatCannotBe_AreRefused) {
  const auto good = recordings::filmed(kFlashes, {}, {.rate = 30, .rows = 4, .readout = 0.016}, 30, 1);
  auto uneven = good, back = good;
  uneven.luma.pop_back();
  std::swap(back.times[3], back.times[4]);
  for (const Brightness& bad : {uneven, back}) {
    const auto lag = flash_lag(good, bad, {});
    ASSERT_FALSE(lag);
    EXPECT_EQ(lag.error().code, Errc::kBadValue);
  }
}

}  // namespace
}  // namespace nodal::timing
