#include "hal/sim/scene/lens.h"

#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/angles.h"
#include "tests/support/rigs.h"

namespace nodal::hal::sim {
namespace {

HeadCalibration head_with(LensModel lens, double max_angle = 0) {
  HeadCalibration head = test::plain_head("cam0", 1000, 1000);
  head.lens = std::move(lens);
  head.max_angle = max_angle;
  return head;
}

double angle_to_axis(const Direction& d) { return std::atan2(std::hypot(d.x, d.y), d.z); }

struct Known {
  const char* name;
  LensModel lens;
  /// Original radius for an angle, from the model's definition.
  double (*radius)(double angle);
  double widest;  ///< rad, inside a 500 px circle
};

class EveryLens : public testing::TestWithParam<Known> {};

TEST_P(EveryLens, PointAtTheRadiusOfAnAngle_LooksThatFarFromTheAxis) {
  const LensTruth lens(head_with(GetParam().lens));
  for (int i = 1; i <= 50; ++i) {
    const double angle = GetParam().widest * i / 50;
    const double r = GetParam().radius(angle);
    for (const double turn : {0.0, 0.7, 2.0, 4.4}) {
      const auto ray = lens.ray(500 + r * std::cos(turn), 500 + r * std::sin(turn));
      ASSERT_TRUE(ray) << angle;
      EXPECT_NEAR(angle_to_axis(*ray), angle, 2e-7);
      EXPECT_NEAR(ray->x * std::sin(turn) - ray->y * std::cos(turn), 0, 1e-9) << "turned about the axis";
      EXPECT_NEAR(std::hypot(ray->x, std::hypot(ray->y, ray->z)), 1, 1e-6);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, EveryLens,
    testing::Values(
        Known{"Rectilinear", RectilinearLens{{400, 0, -20}},
              [](double a) { return 400 * std::tan(a) - 20 * std::pow(std::tan(a), 3); }, 0.85},
        Known{"Equidistant", EquidistantLens{{200}}, [](double a) { return 200 * a; }, 2.4},
        Known{"EquidistantBent", EquidistantLens{{210, -4, 2}},
              [](double a) { return 210 * a - 4 * a * a + 2 * a * a * a; }, 2.1},
        Known{"KannalaBrandt", KannalaBrandtLens{230, {-0.02, 0.003, -0.0002, 0.00001}},
              [](double a) {
                return 230 * (a - 0.02 * std::pow(a, 3) + 0.003 * std::pow(a, 5) - 0.0002 * std::pow(a, 7) +
                              0.00001 * std::pow(a, 9));
              },
              2.0},
        // Tsai is the inverse: its radius is the root of r (1 + k1 r^2 + k2 r^4) = f tan(angle), here by Newton.
        Known{"TsaiOfFigure3", TsaiLens{490, 2.29e-6, 1.65e-11},
              [](double a) {
                double r = 490 * std::tan(a) / 1.5;
                for (int k = 0; k < 60; ++k) {
                  const double r2 = r * r;
                  const double value = r * (1 + 2.29e-6 * r2 + 1.65e-11 * r2 * r2) - 490 * std::tan(a);
                  r -= value / (1 + 3 * 2.29e-6 * r2 + 5 * 1.65e-11 * r2 * r2);
                }
                return r;
              },
              1.0}),
    [](const auto& known) { return std::string(known.param.name); });

TEST(LensTruth, FisheyeBeyond180Degrees_LooksBehindItself) {
  const LensTruth lens(head_with(EquidistantLens{{200}}));
  const auto ray = lens.ray(500 + 200 * 2.0, 500);
  ASSERT_TRUE(ray);
  EXPECT_NEAR(ray->z, std::cos(2.0), 1e-6);
  EXPECT_LT(ray->z, 0);
}

TEST(LensTruth, AxesOfThePicture_AreRightAndDown) {
  const LensTruth lens(test::plain_head("cam0", 640, 480));
  EXPECT_GT(lens.ray(400, 240)->x, 0);
  EXPECT_NEAR(lens.ray(400, 240)->y, 0, 1e-12);
  EXPECT_GT(lens.ray(320, 300)->y, 0);
  EXPECT_NEAR(lens.ray(320, 240)->z, 1, 1e-12);
}

TEST(LensTruth, HeadTurnedRight_ItsAxisIsToTheRightInTheRig) {
  const auto ray = LensTruth(test::plain_head("cam1", 640, 480, 90)).ray(320, 240);
  ASSERT_TRUE(ray);
  EXPECT_NEAR(ray->x, 1, 1e-12);
  EXPECT_NEAR(ray->z, 0, 1e-12);
}

// f_y = aspect * f_x: the same number of pixels vertically is a smaller angle.
TEST(LensTruth, PixelAspect_DividesTheRowsAngle) {
  HeadCalibration head = test::plain_head("cam0", 640, 480);
  head.aspect = 1.083;
  const LensTruth lens(head);
  const double f = 320;
  EXPECT_NEAR(std::atan2(lens.ray(320, 340)->y, lens.ray(320, 340)->z), std::atan(100 / 1.083 / f), 1e-7);
  EXPECT_NEAR(std::atan2(lens.ray(420, 240)->x, lens.ray(420, 240)->z), std::atan(100 / f), 1e-7);
}

TEST(LensTruth, BeyondTheTurningPoint_NoLight) {
  // 200 a - 30 a^3 turns where 200 = 90 a^2.
  const LensTruth lens(head_with(EquidistantLens{{200, 0, -30}}));
  const double turn = std::sqrt(200.0 / 90);
  const double r = 200 * turn - 30 * turn * turn * turn;
  EXPECT_TRUE(lens.ray(500 + r - 1, 500));
  EXPECT_FALSE(lens.ray(500 + r + 1, 500));
  EXPECT_EQ(lens.footprint(500 + r + 1, 500), 0);
}

TEST(LensTruth, BeyondMaxAngle_NoLight) {
  const LensTruth lens(head_with(EquidistantLens{{200}}, 1.5));
  EXPECT_TRUE(lens.ray(500 + 299.9, 500));
  EXPECT_FALSE(lens.ray(500 + 300.1, 500));
}

TEST(LensTruth, OutsideTheRegion_NoLight) {
  HeadCalibration head = head_with(EquidistantLens{{200}});
  head.region = {100, 50, 900, 950, Region::Circle{500, 500, 420}};
  const LensTruth lens(head);
  EXPECT_TRUE(lens.ray(500, 500));
  EXPECT_FALSE(lens.ray(99, 500)) << "left of the rectangle";
  EXPECT_FALSE(lens.ray(500, 40)) << "above it";
  EXPECT_FALSE(lens.ray(500 + 400, 500 + 200)) << "outside of the circle";
}

// Pixels of a 90 x 90 degree pinhole cover a sixth of the sphere.
TEST(LensTruth, FootprintsSquared_SumToTheSolidAngle) {
  const LensTruth lens(test::plain_head("cam0", 400, 400));
  double sum = 0;
  for (int j = 0; j < 400; ++j) {
    for (int i = 0; i < 400; ++i) sum += std::pow(lens.footprint(i + 0.5, j + 0.5), 2);
  }
  EXPECT_NEAR(sum, 4 * kPi / 6, 2e-3);
}

}  // namespace
}  // namespace nodal::hal::sim
