#include "stitch/calibration/lens/scale_space.h"

#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::calibration {
namespace {

GreyImage wave(int width, int height, double period_x) {
  GreyImage image(width, height);
  for (int j = 0; j < height; ++j) {
    for (int i = 0; i < width; ++i) {
      image.row(j)[i] = static_cast<float>(0.5 + 0.4 * std::sin(2 * kPi * (i + 0.5) / period_x));
    }
  }
  return image;
}

TEST(Blurred, Sinusoid_KeepsItsPhaseAndLosesWhatTheGaussianTakes) {
  const double period = 16;
  const double sigma = 2.5;
  const GreyImage blurry = blurred(wave(256, 32, period), sigma);
  const double w = 2 * kPi / period;
  const double amplitude = 0.4 * std::exp(-0.5 * sigma * sigma * w * w);
  for (int i = 40; i < 200; ++i) {
    EXPECT_NEAR(blurry.row(16)[i], 0.5 + amplitude * std::sin(w * (i + 0.5)), 1e-4);
  }
}

TEST(Halved, Place_IsAtHalfItsCoordinates) {
  const GreyImage half = halved(wave(512, 64, 64));
  ASSERT_EQ(half.width, 256);
  const double w = 2 * kPi / 64;
  const double amplitude = 0.4 * std::exp(-0.5 * 3 * kLevelSigma * kLevelSigma * w * w);
  for (int i = 40; i < 200; ++i) {
    EXPECT_NEAR(half.row(16)[i], 0.5 + amplitude * std::sin(w * 2 * (i + 0.5)), 1e-4);
  }
}

TEST(ScaleSpace, LongWave_HasItsValueAndSlopeAtAnyBlurAndPlace) {
  const double period = 200;
  const double w = 2 * kPi / period;
  const ScaleSpace space(wave(1024, 256, period));
  for (const double sigma : {0.9, 1.7, 3.0, 7.2, 11.0}) {
    for (const double x : {300.0, 333.3, 401.75, 500.5}) {
      const ScaleSpace::Sample s = space.at(x, 120.2, sigma);
      const double amplitude = 0.4 * std::exp(-0.5 * sigma * sigma * w * w);
      EXPECT_NEAR(s.value, 0.5 + amplitude * std::sin(w * x), 6e-3) << sigma << " " << x;
      EXPECT_NEAR(s.dx, amplitude * w * std::cos(w * x), 2e-4) << sigma << " " << x;
      EXPECT_NEAR(s.dy, 0, 1e-5);
    }
  }
}

TEST(ScaleSpace, Slopes_AreWhatDifferencesOfValuesSay) {
  GreyImage image(200, 160);
  unsigned state = 1;
  for (float& value : image.values) {
    state = state * 1664525U + 1013904223U;
    value = static_cast<float>(state >> 8) / static_cast<float>(1 << 24);
  }
  const ScaleSpace space(image);
  constexpr double kStep = 1e-3;
  for (const double sigma : {1.0, 1.6, 2.9, 4.4}) {
    const double x = 90.37, y = 71.81;
    const auto s = space.at(x, y, sigma);
    const double dx = (space.at(x + kStep, y, sigma).value - space.at(x - kStep, y, sigma).value) / (2 * kStep);
    const double dy = (space.at(x, y + kStep, sigma).value - space.at(x, y - kStep, sigma).value) / (2 * kStep);
    const double grow = std::exp2(kStep);
    const double ds = (space.at(x, y, sigma * grow).value - space.at(x, y, sigma / grow).value) / (2 * kStep);
    EXPECT_NEAR(s.dx, dx, 2e-3 * std::abs(dx) + 1e-4);
    EXPECT_NEAR(s.dy, dy, 2e-3 * std::abs(dy) + 1e-4);
    EXPECT_NEAR(s.dscale, ds, 2e-3 * std::abs(ds) + 1e-4);
  }
}

}  // namespace
}  // namespace nodal::calibration
