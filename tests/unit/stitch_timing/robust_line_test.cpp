// Lines through lags with outliers, and whether their claimed errors are true.
#include "stitch/timing/robust_line.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace nodal::timing {
namespace {

constexpr LineOptions kOptions{.tolerance = 1e-3, .least_scatter = 1e-6};

std::vector<LagPoint> on_line(int count, double lag, double rate, double noise, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, noise);
  std::vector<LagPoint> points;
  for (int i = 0; i < count; ++i) points.push_back({10.0 * i, lag + rate * 10 * i + normal(random)});
  return points;
}

TEST(RobustLine, ThirdOfLagsWrong_LineIsThatOfTheOthers) {
  auto points = on_line(30, 1.5, 40e-6, 20e-6, 1);
  for (std::size_t i = 0; i < 30; i += 3) points[i].lag += 0.1 * static_cast<double>(i) - 1;
  const auto line = robust_line(points, kOptions);
  ASSERT_TRUE(line);
  EXPECT_EQ(line->used, 20);
  EXPECT_EQ(line->measured, 30);
  EXPECT_NEAR(line->value(0), 1.5, 5 * line->sigma(0));
  EXPECT_LT(line->sigma(0), 20e-6);
  EXPECT_NEAR(line->rate, 40e-6, 1e-6);
}

TEST(RobustLine, FewerThanThreeAgree_IsNothing) {
  EXPECT_FALSE(robust_line(on_line(2, 1, 0, 0, 1), kOptions));
  const std::vector<LagPoint> apart{{0, 0}, {10, 1}, {20, 0.3}, {30, -2}};
  EXPECT_FALSE(robust_line(apart, kOptions));
  EXPECT_FALSE(robust_line({}, kOptions));
}

TEST(RobustLine, RateNoClockHas_IsNotALine) {
  EXPECT_FALSE(robust_line(on_line(10, 1, 500e-6, 0, 1), kOptions));
  EXPECT_TRUE(robust_line(on_line(10, 1, 250e-6, 0, 1), kOptions));
}

TEST(RobustLine, ManyDraws_TwoSigmaHoldNineteenOfTwentyErrors) {
  for (const int count : {4, 6, 12, 50}) {
    double lags = 0, rates = 0;
    constexpr int kDraws = 1000;
    for (int i = 0; i < kDraws; ++i) {
      const auto line = robust_line(on_line(count, 2, 30e-6, 100e-6, static_cast<std::uint32_t>(100 + i)), kOptions);
      ASSERT_TRUE(line);
      lags += std::abs(line->value(0) - 2) < 2 * line->sigma(0);
      rates += std::abs(line->rate - 30e-6) < 2 * std::sqrt(line->rate_variance);
    }
    // A normal distribution has 0.954 within two sigma; chance of 1000 draws: 0.007.
    EXPECT_NEAR(lags / kDraws, 0.954, 0.025) << count;
    EXPECT_NEAR(rates / kDraws, 0.954, 0.025) << count;
  }
}

}  // namespace
}  // namespace nodal::timing
