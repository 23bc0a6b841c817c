// Image circles drawn with a blurred edge over scenes that are partly dark.
#include "stitch/autocalibration/image_circle.h"

#include <gtest/gtest.h>

#include <algorithm>

#include <cmath>
#include <random>

namespace nodal::autocalibration {
namespace {

struct Drawn {
  int width = 800, height = 600;
  Region::Circle circle{400, 300, 260};
  double blur = 6;        ///< px, from light to dark
  double outside = 6;     ///< level
  double dark_share = 0;  ///< share of the directions from the middle in which the scene is dark there
  double level = 150;
};

Picture draw(const Drawn& drawn) {
  Picture picture{drawn.width, drawn.height, {}};
  std::mt19937_64 random(1);
  std::normal_distribution<float> noise(0, 2);
  for (int y = 0; y < drawn.height; ++y) {
    for (int x = 0; x < drawn.width; ++x) {
      const double dx = x + 0.5 - drawn.circle.x, dy = y + 0.5 - drawn.circle.y;
      const double inside = std::clamp((drawn.circle.radius - std::hypot(dx, dy)) / drawn.blur, 0.0, 1.0);
      const double turn = std::atan2(dy, dx) / 6.2831853 + 0.5;
      const double scene = turn < drawn.dark_share ? 5 : drawn.level + 60 * std::sin(x * 0.05) * std::cos(y * 0.08);
      const double level = drawn.outside + inside * std::max(0.0, scene - drawn.outside);
      picture.values.push_back(std::clamp(static_cast<float>(level) + noise(random), 0.0F, 255.0F));
    }
  }
  return picture;
}

void expect_found(const Drawn& drawn, double within) {
  const auto found = find_image_circle(draw(drawn));
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->x, drawn.circle.x, within);
  EXPECT_NEAR(found->y, drawn.circle.y, within);
  // The inner side of the edge, never outside of it.
  EXPECT_LT(found->radius, drawn.circle.radius);
  EXPECT_GT(found->radius, drawn.circle.radius - drawn.blur - 14);
}

TEST(ImageCircle, WholeCircle) { expect_found({}, 2); }
TEST(ImageCircle, BesideTheMiddle) { expect_found({.circle = {360, 320, 250}}, 2); }
TEST(ImageCircle, CutOffAboveAndBelow) { expect_found({.circle = {390, 310, 370}}, 6); }
TEST(ImageCircle, WideBlurAndStrayLight) { expect_found({.blur = 25, .outside = 18}, 4); }
TEST(ImageCircle, ThirdOfTheSceneDark) { expect_found({.dark_share = 0.33}, 3); }

TEST(ImageCircle, OrdinaryPicturesHaveNone) {
  EXPECT_FALSE(find_image_circle(draw({.circle = {400, 300, 5000}})));                     // no border
  EXPECT_FALSE(find_image_circle(draw({.circle = {400, 300, 5000}, .level = 10})));        // a night
  EXPECT_FALSE(find_image_circle(draw({.circle = {400, 300, 5000}, .dark_share = 0.5})));  // half of it is dark
  EXPECT_FALSE(find_image_circle(draw({.circle = {400, 300, 60}})));                       // a lamp
}

TEST(ImageCircle, StraightBlackBands_AreNone) {
  Picture picture = draw({.circle = {400, 300, 5000}});
  for (int y = 0; y < 600; ++y) {
    for (int x = 0; x < 800; ++x) {
      if (x < 90 || x >= 710) picture.values[static_cast<std::size_t>(y * 800 + x)] = 3;
    }
  }
  EXPECT_FALSE(find_image_circle(picture));
}

TEST(ImageCircle, SmallestPictures_AreAllowed) {
  for (const int side : {1, 2, 7, 30}) {
    EXPECT_FALSE(find_image_circle({side, side, std::vector<float>(static_cast<std::size_t>(side * side), 100)}));
  }
}

}  // namespace
}  // namespace nodal::autocalibration
