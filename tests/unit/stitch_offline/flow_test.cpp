#include "stitch/offline/flow.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace nodal::offline {
namespace {

/// Detail of wavelengths from 6 px on, at any position.
float texture(double x, double y) {
  double sum = 0;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> direction(0, 6.2831853), phase(0, 6.2831853);
  for (const double wavelength : {6.0, 9.0, 13.0, 20.0, 31.0, 47.0, 70.0, 110.0}) {
    const double turn = direction(random);
    sum += std::sin(6.2831853 / wavelength * (x * std::cos(turn) + y * std::sin(turn)) + phase(random));
  }
  return static_cast<float>(128 + 14 * sum);
}

constexpr int kAcross = 160, kDown = 96;
constexpr int kBorder = 20;  ///< px that are not compared: one of the pictures may end there

SeenPicture picture(const std::function<float(double, double)>& level) {
  SeenPicture made{kAcross, kDown, {}, std::vector<float>(kAcross * kDown, 1.0F)};
  for (int y = 0; y < kDown; ++y) {
    for (int x = 0; x < kAcross; ++x) made.levels.push_back(level(x, y));
  }
  return made;
}

/// The largest distance from the true flow inside the edge.
double worst(const Flow& flow, const std::function<std::pair<double, double>(int, int)>& truth) {
  double most = 0;
  for (int y = kBorder; y < kDown - kBorder; ++y) {
    for (int x = kBorder; x < kAcross - kBorder; ++x) {
      const auto k = static_cast<std::size_t>(y * kAcross + x);
      const auto [dx, dy] = truth(x, y);
      most = std::max(most, std::hypot(static_cast<double>(flow.x[k]) - dx, static_cast<double>(flow.y[k]) - dy));
    }
  }
  return most;
}

TEST(Flow, OfTwoEqualPictures_IsZero) {
  const SeenPicture a = picture(texture);
  const Flow flow = flow_between(a, a, std::vector<float>(kAcross * kDown, 0.3F));
  EXPECT_LT(worst(flow, [](int, int) { return std::pair(0.0, 0.0); }), 1e-4);
}

TEST(Flow, OfAMovedPicture_IsItsMove_WhateverTheShares) {
  const std::pair<double, double> move{9.3, -4.6};
  for (const double share : {0.0, 0.25, 1.0}) {
    const SeenPicture a = picture(
        [&](double x, double y) { return texture(x + (1 - share) * move.first, y + (1 - share) * move.second); });
    const SeenPicture b =
        picture([&](double x, double y) { return texture(x - share * move.first, y - share * move.second); });
    const Flow flow = flow_between(a, b, std::vector<float>(kAcross * kDown, static_cast<float>(share)));
    EXPECT_LT(worst(flow, [&](int, int) { return move; }), 0.15) << share;
  }
}

TEST(Flow, OfATurnedAndScaledPicture_FollowsEachPixel) {
  const double c = 1.04 * std::cos(0.03), s = 1.04 * std::sin(0.03);
  const auto there = [&](double x, double y) {
    const double u = x - kAcross / 2, v = y - kDown / 2;
    return std::pair(c * u - s * v - u, s * u + c * v - v);
  };
  const SeenPicture a = picture(texture);
  const SeenPicture b = picture([&](double x, double y) {
    const double u = x - kAcross / 2, v = y - kDown / 2, n = c * c + s * s;
    return texture(kAcross / 2 + (c * u + s * v) / n, kDown / 2 + (-s * u + c * v) / n);
  });
  const Flow flow = flow_between(a, b, std::vector<float>(kAcross * kDown, 1.0F));
  EXPECT_LT(worst(flow, [&](int x, int y) { return there(x, y); }), 0.2);
}

TEST(Flow, BetweenPicturesOfDifferentBrightness_IsTheSame) {
  const SeenPicture a = picture(texture);
  const SeenPicture b = picture([](double x, double y) { return 0.8F * texture(x - 3, y - 1) + 40; });
  const Flow flow = flow_between(a, b, std::vector<float>(kAcross * kDown, 1.0F));
  EXPECT_LT(worst(flow, [](int, int) { return std::pair(3.0, 1.0); }), 0.3);
}

TEST(Flow, BeyondWhatBothShow_GoesOn) {
  SeenPicture a = picture([](double x, double y) { return texture(x + 2, y); });
  SeenPicture b = picture([](double x, double y) { return texture(x - 2, y); });
  constexpr int kLast = kAcross / 2;
  for (int y = 0; y < kDown; ++y) {
    for (int x = kLast; x < kAcross; ++x) {
      const auto k = static_cast<std::size_t>(y * kAcross + x);
      a.seen[k] = b.seen[k] = 0;
      a.levels[k] = b.levels[k] = 0;
    }
  }
  const Flow flow = flow_between(a, b, std::vector<float>(kAcross * kDown, 0.5F));
  for (int y = kBorder; y < kDown - kBorder; ++y) {
    for (int x = kBorder; x < kLast + 8; ++x) {
      const auto k = static_cast<std::size_t>(y * kAcross + x);
      const double tolerance = x < kLast - 10 ? 0.3 : 1.2;
      ASSERT_NEAR(flow.x[k], 4, tolerance) << x << ", " << y;
      ASSERT_NEAR(flow.y[k], 0, tolerance) << x << ", " << y;
    }
  }
}

}  // namespace
}  // namespace nodal::offline
