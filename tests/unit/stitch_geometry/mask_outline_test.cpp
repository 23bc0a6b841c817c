// Polygons around masks that were drawn as pictures, beside the pictures themselves.
#include "stitch/geometry/mask_outline.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "stitch/geometry/masks.h"

namespace nodal::geometry {
namespace {

HiddenPixels drawn(int width, int height, const std::function<bool(double, double)>& hidden) {
  HiddenPixels pixels{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) pixels.values.push_back(hidden(x + 0.5, y + 0.5) ? 1 : 0);
  }
  return pixels;
}

/// The same with the neighbours of all hidden pixels.
HiddenPixels grown(const HiddenPixels& hidden) {
  HiddenPixels more = hidden;
  for (int y = 0; y < hidden.height; ++y) {
    for (int x = 0; x < hidden.width; ++x) {
      if (!hidden.at(x, y)) continue;
      for (int j = std::max(0, y - 1); j <= std::min(hidden.height - 1, y + 1); ++j) {
        for (int i = std::max(0, x - 1); i <= std::min(hidden.width - 1, x + 1); ++i) more.hide(i, j);
      }
    }
  }
  return more;
}

struct Wrong {
  int shown = 0;    ///< hidden pixels that no polygon covers
  int far_off = 0;  ///< covered pixels that are farther from a hidden one than allowed
  int any = 0;      ///< pixels that differ
};

Wrong compared(const HiddenPixels& hidden, const MaskOutline& outline) {
  const Masks masks(Region{0, 0, 1, 1, {}, outline.polygons});
  Wrong wrong;
  const int reach = static_cast<int>(std::ceil(outline.more_px));
  for (int y = 0; y < hidden.height; ++y) {
    for (int x = 0; x < hidden.width; ++x) {
      const bool covered = masks.distance({x + 0.5, y + 0.5}, 1e9) < 0;
      wrong.any += covered != hidden.at(x, y) ? 1 : 0;
      wrong.shown += hidden.at(x, y) && !covered ? 1 : 0;
      if (!covered) continue;
      bool near = false;
      for (int j = std::max(0, y - reach); j <= std::min(hidden.height - 1, y + reach) && !near; ++j) {
        for (int i = std::max(0, x - reach); i <= std::min(hidden.width - 1, x + reach) && !near; ++i)
          near = hidden.at(i, j);
      }
      wrong.far_off += near ? 0 : 1;
    }
  }
  return wrong;
}

std::size_t corners_of(const MaskOutline& outline) {
  std::size_t corners = 0;
  for (const auto& polygon : outline.polygons) corners += polygon.size();
  return corners;
}

TEST(MaskOutline, OfFewCorners_IsExact) {
  const auto square = outline_of(drawn(40, 30, [](double x, double y) { return x > 10 && x < 20 && y > 5 && y < 9; }));
  ASSERT_TRUE(square);
  ASSERT_EQ(square->polygons.size(), 1U);
  EXPECT_EQ(square->polygons[0].size(), 4U);
  EXPECT_EQ(square->polygons[0][0], (Region::Point{21, 4}));
  EXPECT_EQ(square->more_px, 1);
  const auto is_hidden = {
      std::function([](double x, double y) { return x < 12 || y > 25; }),  // along the edges
      std::function([](double x, double y) { return std::abs(x - 20) > 8 || std::abs(y - 15) > 6; }),  // around
      std::function([](double x, double y) { return (x < 20) == (y < 15); }),  // parts meet at a corner
      std::function([](double, double) { return true; }),
      std::function([](double x, double y) {  // a hole with an island that has a hole
        const double r = std::max(std::abs(x - 20), std::abs(y - 15));
        return (r > 10 && r < 13) || (r > 2 && r < 6);
      }),
  };
  for (const auto& hidden : is_hidden) {
    const HiddenPixels pixels = drawn(40, 30, hidden);
    const auto outline = outline_of(pixels);
    ASSERT_TRUE(outline);
    EXPECT_EQ(compared(grown(pixels), *outline).any, 0);
  }
  EXPECT_TRUE(outline_of(drawn(40, 30, [](double, double) { return false; }))->polygons.empty());
}

TEST(MaskOutline, AroundACircle_LeavesTheCircleVisible) {
  const HiddenPixels pixels = drawn(600, 600, [](double x, double y) { return std::hypot(x - 300, y - 290) > 260; });
  const auto outline = outline_of(pixels);
  ASSERT_TRUE(outline) << outline.error().message;
  const Wrong wrong = compared(pixels, *outline);
  EXPECT_EQ(wrong.shown, 0);
  EXPECT_EQ(wrong.far_off, 0);
  EXPECT_LE(outline->more_px, 3);
  EXPECT_LE(corners_of(*outline), kMaxMaskPoints);
}

TEST(MaskOutline, DrawnByHand_CoversAllThatIsHiddenAndLittleMore) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    std::mt19937 random(seed);
    std::vector<std::array<double, 3>> dabs;  // x, y and radius, px
    double x = 200, y = 200;
    for (int k = 0; k < 60; ++k) {
      x += static_cast<double>(random() % 41) - 20, y += static_cast<double>(random() % 41) - 20;
      dabs.push_back({x, y, 4 + static_cast<double>(random() % 16)});
    }
    const HiddenPixels pixels = drawn(400, 400, [&](double u, double v) {
      return std::ranges::any_of(dabs, [&](const auto& d) { return std::hypot(u - d[0], v - d[1]) < d[2]; });
    });
    const auto outline = outline_of(pixels);
    ASSERT_TRUE(outline) << outline.error().message;
    const Wrong wrong = compared(pixels, *outline);
    EXPECT_EQ(wrong.shown, 0) << seed;
    EXPECT_EQ(wrong.far_off, 0) << seed;
    EXPECT_LE(outline->polygons.size(), kMaxMasks);
    EXPECT_LE(corners_of(*outline), kMaxMaskPoints);
    EXPECT_LE(outline->more_px, 6) << seed;
  }
}

TEST(MaskOutline, OfNoise_IsRefused) {
  std::mt19937 random(1);
  const auto outline = outline_of(drawn(700, 500, [&](double, double) { return random() % 300 == 0; }));
  ASSERT_FALSE(outline);
  EXPECT_EQ(outline.error().code, Errc::kTooLarge);
}

}  // namespace
}  // namespace nodal::geometry
