// Lenses against independent numbers: by hand, by OpenCV's formula, from the paper's figure.
#include <gtest/gtest.h>

#include <cmath>

#include "examples.h"
#include "protocol/base/angles.h"
#include "stitch/geometry/lens/lens.h"

namespace nodal::geometry {
namespace {

Lens lens_of(const LensModel& model, double max_angle = 0) {
  Result<Lens> lens = Lens::make(model, max_angle);
  EXPECT_TRUE(lens) << lens.error().text();
  return *lens;
}

TEST(Tsai, Figure3_StretchesByOneAndAHalfAtTheSideAndNearlyTwoInTheCorner) {
  const Lens lens = lens_of(figure3_lens());
  // 1 + 2.29e-6 * 360^2 + 1.65e-11 * 360^4 = 1 + 0.296784 + 0.277136...
  const double at_side = 360 * (1 + 2.29e-6 * 129600 + 1.65e-11 * 129600.0 * 129600.0);
  EXPECT_NEAR(at_side / 360, 1.574, 5e-4);
  EXPECT_NEAR(*lens.angle(360), std::atan(at_side / 490), 1e-15);
  // The farthest corner of 720x480 from (360.8, 224.6), with the aspect of 1.083 divided out: r = 432.0.
  const double corner = std::hypot(360.8, (480 - 224.6) / 1.083);
  EXPECT_NEAR(std::tan(*lens.angle(corner)) * 490 / corner, 2.0, 0.02);
  // The notes' value 1.94 is for the opposite corner, 224.6 px up: r = 416 from its side.
  EXPECT_NEAR(std::tan(*lens.angle(std::hypot(360.8, 224.6))) * 490 / std::hypot(360.8, 224.6), 1.94, 0.02);
}

TEST(Tsai, WithoutDistortion_IsAPinhole) {
  const Lens lens = lens_of(TsaiLens{500, 0, 0});
  for (const double degrees : {1.0, 30.0, 60.0, 80.0}) {
    const double a = degrees * kPi / 180;
    EXPECT_NEAR(*lens.radius(a), 500 * std::tan(a), 1e-9);
    EXPECT_NEAR(lens.slope(a), 500 / std::pow(std::cos(a), 2), 1e-6);
  }
}

TEST(Rectilinear, ItsPolynomial_IsOfTheTangent) {
  const Lens lens = lens_of(RectilinearLens{{500, 0, -60}});
  const double t = 0.75;
  EXPECT_NEAR(*lens.radius(std::atan(t)), 500 * t - 60 * t * t * t, 1e-10);
  // Turns at t = sqrt(500 / 180).
  EXPECT_NEAR(lens.max_angle(), std::atan(std::sqrt(500.0 / 180)), 1e-12);
  EXPECT_FALSE(lens.radius(lens.max_angle() + 1e-6));
}

TEST(KannalaBrandt, AgreesWithOpenCvsFisheyeFormula) {
  // cv::fisheye: theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8), theta = atan(r_ideal).
  const double f = 285, k1 = -0.0034, k2 = 0.0007, k3 = -0.0021, k4 = 0.0003;
  const Lens lens = lens_of(KannalaBrandtLens{f, {k1, k2, k3, k4}});
  for (const double ideal : {0.01, 0.3, 1.0, 2.5}) {
    const double theta = std::atan(ideal), t2 = theta * theta;
    const double theta_d = theta * (1 + k1 * t2 + k2 * t2 * t2 + k3 * t2 * t2 * t2 + k4 * t2 * t2 * t2 * t2);
    EXPECT_NEAR(*lens.radius(theta), f * theta_d, 1e-10);
  }
}

TEST(KannalaBrandt, AtOneRadian_IsTheSumOfItsCoefficients) {
  EXPECT_NEAR(*lens_of(KannalaBrandtLens{100, {0.1, 0.01, 0.001, 0.0001}}).radius(1.0), 111.11, 1e-12);
}

TEST(Equidistant, SeesBehindItself) {
  const Lens lens = lens_of(EquidistantLens{{300}});
  EXPECT_NEAR(*lens.radius(110 * kPi / 180), 300 * 110 * kPi / 180, 1e-10);
  EXPECT_NEAR(*lens.angle(700), 700.0 / 300, 1e-15);
  EXPECT_NEAR(lens.max_angle(), kPi, 1e-15);
}

TEST(Lens, MaxAngle_CapsTheLens) {
  const Lens lens = lens_of(EquidistantLens{{300}}, 1.0);
  EXPECT_EQ(lens.max_angle(), 1.0);
  EXPECT_NEAR(lens.max_radius(), 300, 1e-12);
  EXPECT_TRUE(lens.radius(1.0));
  EXPECT_FALSE(lens.radius(1 + 1e-11));
  EXPECT_FALSE(lens.angle(300.0001));
}

TEST(Lens, BeyondItsTurningPoint_GivesNothing) {
  const Lens lens = lens_of(TsaiLens{400, -1.5e-6, 0});
  const double turn = std::sqrt(1 / 4.5e-6);
  EXPECT_NEAR(lens.max_radius(), turn, 1e-9);
  EXPECT_TRUE(lens.angle(turn * (1 - 1e-12)));
  EXPECT_FALSE(lens.angle(turn * (1 + 1e-9)));
  EXPECT_FALSE(lens.radius(lens.max_angle() + 1e-9));
}

TEST(Lens, NonsenseGoesIn_NothingComesOut) {
  const Lens lens = lens_of(figure3_lens());
  EXPECT_FALSE(lens.radius(-0.1));
  EXPECT_FALSE(lens.radius(std::nan("")));
  EXPECT_FALSE(lens.angle(-1));
  EXPECT_FALSE(lens.angle(std::nan("")));
}

TEST(Lens, MaxAngleBeyondTheTurn_IsRefused) {
  const Result<Lens> lens = Lens::make(EquidistantLens{{300, -50}}, 3.05);
  ASSERT_FALSE(lens);
  EXPECT_EQ(lens.error().code, Errc::kLensDomain);
}

}  // namespace
}  // namespace nodal::geometry
