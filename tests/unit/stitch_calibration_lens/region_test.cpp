#include "stitch/calibration/lens/region.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nodal::calibration {
namespace {

/// Grey with texture where `inside`, nearly black elsewhere.
template <class Inside>
GreyImage picture(int width, int height, Inside inside) {
  GreyImage image(width, height);
  for (int j = 0; j < height; ++j) {
    for (int i = 0; i < width; ++i) {
      const auto texture = static_cast<float>(0.25 * std::sin(0.7 * i) * std::cos(0.9 * j));
      image.row(j)[i] = inside(i + 0.5, j + 0.5) ? 0.5F + texture : 0.01F;
    }
  }
  return image;
}

TEST(FindRegion, BlackBands_AreCutOff) {
  const GreyImage image = picture(300, 200, [](double x, double y) { return x > 12 && x < 290 && y > 5; });
  const Region region = find_region({&image});
  EXPECT_FALSE(region.circle);
  EXPECT_NEAR(region.left, 12, 1.5);
  EXPECT_NEAR(region.right, 290, 1.5);
  EXPECT_NEAR(region.top, 5, 1.5);
  EXPECT_EQ(region.bottom, 200);
  EXPECT_GE(region.left, 12);
  EXPECT_LE(region.right, 290);
}

TEST(FindRegion, CircleOfAFisheye_IsFoundThoughItsTopIsCutOff) {
  const GreyImage image = picture(400, 300, [](double x, double y) { return std::hypot(x - 205, y - 140) < 170; });
  const Region region = find_region({&image});
  ASSERT_TRUE(region.circle);
  EXPECT_NEAR(region.circle->x, 205, 1);
  EXPECT_NEAR(region.circle->y, 140, 1);
  EXPECT_NEAR(region.circle->radius, 169, 1.5);
}

TEST(FindRegion, WhatIsDarkInOnePhotographOnly_IsNoBorder) {
  const GreyImage left_dark = picture(300, 200, [](double x, double) { return x > 150; });
  const GreyImage right_dark = picture(300, 200, [](double x, double) { return x < 200; });
  const Region region = find_region({&left_dark, &right_dark});
  EXPECT_EQ(region.left, 0);
  EXPECT_EQ(region.right, 300);
  EXPECT_FALSE(region.circle);
}

TEST(FindRegion, AllBlackOrAllBright_IsTheWholePicture) {
  const GreyImage black = picture(100, 80, [](double, double) { return false; });
  const GreyImage bright = picture(100, 80, [](double, double) { return true; });
  for (const GreyImage* image : {&black, &bright}) {
    const Region region = find_region({image});
    EXPECT_EQ(region.right - region.left, 100);
    EXPECT_EQ(region.bottom - region.top, 80);
  }
}

}  // namespace
}  // namespace nodal::calibration
