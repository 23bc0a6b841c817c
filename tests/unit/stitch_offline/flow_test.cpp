#include "stitch/offline/flow.h"

#include <gtest/gtest.h>

#include <algorithm>
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
/// px that are not compared: one of the pictures may end there, and the flow is limited beside it.
constexpr int kBorder = 24;

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
  const auto expected_at = [&](double x, double y) {
    const double u = x - kAcross / 2, v = y - kDown / 2;
    return std::pair(c * u - s * v - u, s * u + c * v - v);
  };
  const SeenPicture a = picture(texture);
  const SeenPicture b = picture([&](double x, double y) {
    const double u = x - kAcross / 2, v = y - kDown / 2, n = c * c + s * s;
    return texture(kAcross / 2 + (c * u + s * v) / n, kDown / 2 + (-s * u + c * v) / n);
  });
  const Flow flow = flow_between(a, b, std::vector<float>(kAcross * kDown, 1.0F));
  EXPECT_LT(worst(flow, [&](int x, int y) { return expected_at(x, y); }), 0.2);
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

/// The least determinant of what the flow does to either picture, over cells of 8 px: 0 or less where one of them
/// folds.
double least_area(const Flow& flow, float share) {
  constexpr int kCell = 8;
  double least = 1;
  const auto at = [&](int x, int y) { return static_cast<std::size_t>(y * kAcross + x); };
  for (int y = kBorder; y < kDown - kBorder - kCell; ++y) {
    for (int x = kBorder; x < kAcross - kBorder - kCell; ++x) {
      const auto slope = [&](const std::vector<float>& v, int dx, int dy) {
        return static_cast<double>(v[at(x + dx, y + dy)] - v[at(x, y)]) / kCell;
      };
      for (const double part : {static_cast<double>(share) - 1, static_cast<double>(share)}) {
        const double xx = 1 + part * slope(flow.x, kCell, 0), xy = part * slope(flow.x, 0, kCell);
        const double yx = part * slope(flow.y, kCell, 0), yy = 1 + part * slope(flow.y, 0, kCell);
        least = std::min(least, xx * yy - xy * yx);
      }
    }
  }
  return least;
}

/// A near object with detail of its own in front of the scene, `move` px apart in the two pictures: what is behind it
/// in one picture is seen in the other.
Flow flow_of_near_object(float move, float share) {
  const auto level = [&](double x, double y, double moved) {
    const double u = x - moved - kAcross / 2.0, v = y - kDown / 2.0;
    return std::abs(u) < 22 && std::abs(v) < 18 ? texture(3 * u + 500, 2 * v + 300) : texture(x, y);
  };
  const double of_a = -(1 - static_cast<double>(share)) * move, of_b = static_cast<double>(share) * move;
  return flow_between(picture([&](double x, double y) { return level(x, y, of_a); }),
                      picture([&](double x, double y) { return level(x, y, of_b); }),
                      std::vector<float>(kAcross * kDown, share));
}

TEST(Flow, OfANearObject_MovesItWhereBothPicturesHaveRoom) {
  const Flow flow = flow_of_near_object(6, 0.5F);
  const auto middle = static_cast<std::size_t>(kDown / 2 * kAcross + kAcross / 2);
  EXPECT_NEAR(flow.x[middle], 6, 0.5);
  EXPECT_GT(least_area(flow, 0.5F), 0);
}

TEST(Flow, OfANearObjectTooFarApart_LeavesItWhereItIs) {
  const Flow flow = flow_of_near_object(14, 1);
  std::size_t moved = 0;
  for (std::size_t k = 0; k < flow.x.size(); ++k) moved += std::hypot(flow.x[k], flow.y[k]) > 4;
  EXPECT_EQ(moved, 0U);
  EXPECT_GT(least_area(flow, 1), 0);
}

TEST(Flow, OfHalvesThatMoveTowardsEachOther_DoesNotFold) {
  for (const float share : {0.0F, 0.5F, 1.0F}) {
    const auto moved = [&](double x, double y, double part) {
      return texture(x < kAcross / 2 ? x + part * 9 : x - part * 9 + 1000, y);
    };
    const double of_a = share - 1, of_b = share;
    const Flow flow = flow_between(picture([&](double x, double y) { return moved(x, y, of_a); }),
                                   picture([&](double x, double y) { return moved(x, y, of_b); }),
                                   std::vector<float>(kAcross * kDown, share));
    EXPECT_GT(least_area(flow, share), 0) << share;
  }
}

TEST(Flow, OfARepeatedPattern_DoesNotFoldWhateverPeriodIsTaken) {
  const auto fence = [](double x, double y, double moved) {
    const bool inside = std::abs(x - kAcross / 2.0) < 30;
    return inside ? static_cast<float>(128 + 90 * std::sin(6.2831853 / 10 * (x - moved))) : texture(x, y);
  };
  for (const double move : {3.0, 5.0, 8.0, 17.0}) {
    const Flow flow = flow_between(picture([&](double x, double y) { return fence(x, y, 0); }),
                                   picture([&](double x, double y) { return fence(x, y, move); }),
                                   std::vector<float>(kAcross * kDown, 1.0F));
    EXPECT_GT(least_area(flow, 1), 0) << move;
  }
}

}  // namespace
}  // namespace nodal::offline
