// Lags from the speed of rotation of a rig that shakes, as gyros and pictures give it.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "recordings.h"
#include "stitch/timing/rotation_lag.h"

namespace nodal::timing {
namespace {

using recordings::Clock;
using recordings::Shake;

Result<Lag> measured(const Shake& shake, Clock a, Clock b, double rate_a, double rate_b, double seconds, double noise,
                     std::uint32_t seed = 1) {
  return rotation_lag(recordings::turned(shake, a, rate_a, seconds, noise, seed),
                      recordings::turned(shake, b, rate_b, seconds, noise, seed + 1), {});
}

TEST(RotationLag, GyrosOfDifferentRates_LagIsTrueToATenthOfAMillisecond) {
  const Clock a{0, 30}, b{1.2345, -50};
  const auto lag = measured(Shake(5), a, b, 200, 3300, 60, 0.02);
  ASSERT_TRUE(lag) << lag.error().text();
  for (const double at : {0.0, 30.0, 60.0}) {
    EXPECT_NEAR(lag->value(at), true_lag(a, b, at), 0.3e-3);
    EXPECT_NEAR(lag->value(at), true_lag(a, b, at), 4 * lag->sigma(at));
  }
}

TEST(RotationLag, PicturesOfDifferentRates_LagIsTrueToTwoMilliseconds) {
  const Clock a{0, 0}, b{-2.7101, 80};
  const auto lag = measured(Shake(6), a, b, 30, 25, 60, 0.03);
  ASSERT_TRUE(lag) << lag.error().text();
  for (const double at : {0.0, 30.0, 60.0}) EXPECT_NEAR(lag->value(at), true_lag(a, b, at), 2e-3) << at;
}

TEST(RotationLag, StillRig_IsRefused) {
  const auto lag = measured(Shake::still(), {}, {0.5, 10}, 200, 200, 60, 0.02);
  ASSERT_FALSE(lag);
  EXPECT_NE(lag.error().message.find("still"), std::string::npos) << lag.error().message;
}

TEST(RotationLag, MotionThatRepeats_IsRefused) {
  const auto lag = measured(Shake::swing(1.3), {}, {0.5, 10}, 60, 60, 60, 0.001);
  ASSERT_FALSE(lag);
  EXPECT_NE(lag.error().message.find("repeats"), std::string::npos) << lag.error().message;
}

TEST(RotationLag, RigsThatMoveDifferently_AreRefused) {
  const auto a = recordings::turned(Shake(1), {}, 60, 60, 0.01, 1),
             b = recordings::turned(Shake(2), {}, 60, 60, 0.01, 2);
  EXPECT_FALSE(rotation_lag(a, b, {}));
}

TEST(RotationLag, GapInTheGyro_IsLeftOut) {
  const Clock a{}, b{0.75, 0};
  auto gyro = recordings::turned(Shake(7), a, 200, 60, 0.01, 1);
  gyro.times.erase(gyro.times.begin() + 4000, gyro.times.begin() + 5000);
  gyro.speeds.erase(gyro.speeds.begin() + 4000, gyro.speeds.begin() + 5000);
  const auto lag = rotation_lag(gyro, recordings::turned(Shake(7), b, 200, 60, 0.01, 2), {});
  ASSERT_TRUE(lag) << lag.error().text();
  EXPECT_NEAR(lag->value(30), -0.75, 0.3e-3);
}

TEST(RotationLag, NumbersThatCannotBe_AreRefused) {
  const auto good = recordings::turned(Shake(7), {}, 60, 30, 0.01, 1);
  auto back = good, endless = good, uneven = good;
  std::swap(back.times[5], back.times[6]);
  endless.speeds[3] = std::nan("");
  uneven.times.pop_back();
  for (const Rotation& bad : {back, endless, uneven, Rotation{}}) {
    const auto lag = rotation_lag(good, bad, {});
    ASSERT_FALSE(lag);
    EXPECT_EQ(lag.error().code, Errc::kBadValue);
  }
}

TEST(RotationLag, ManyDraws_ErrorsAreAsLargeAsClaimed) {
  double squares = 0;
  int found = 0, inside = 0;
  for (std::uint32_t i = 0; i < 60; ++i) {
    const Clock a{0, 20.0 - i}, b{1.1 - 0.07 * i, 3.0 * i};
    const auto lag = measured(Shake(100 + i), a, b, 30, 30, 60, 0.03, 10 * i);
    if (!lag) continue;  // slow motion under that noise may be refused
    const double error = lag->value(lag->at) - true_lag(a, b, lag->at);
    ++found;
    squares += error * error / lag->lag_variance;
    inside += std::abs(error) < 3 * lag->sigma(lag->at);
    EXPECT_LT(std::abs(error), 2e-3);
  }
  EXPECT_GE(found, 30);
  // Mean of 30 squares: 1 +- 0.26.
  EXPECT_LT(squares / found, 2);
  EXPECT_GT(squares / found, 0.3);
  EXPECT_GE(inside, found - 2);
}

}  // namespace
}  // namespace nodal::timing
