#include "protocol/lens_range.h"

#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/angles.h"

namespace nodal {
namespace {

TEST(LensRange, TsaiWithPositiveCoefficients_ReachesAlmostNinetyDegrees) {
  const LensRange range = lens_range(TsaiLens{490, 2.29e-6, 1.65e-11});
  EXPECT_FALSE(range.turns);
  EXPECT_NEAR(range.max_angle, kMaxPinholeAngle, 1e-12);
}

TEST(LensRange, TsaiWithNegativeKappa_EndsWhereOnePlusThreeKappaRSquaredVanishes) {
  // d/dr (r + k r^3) = 0 at r = 1 / sqrt(-3 k); there r_ideal is 2/3 of r.
  const double k = -1e-6;
  const double r = 1 / std::sqrt(3e-6);
  const LensRange range = lens_range(TsaiLens{500, k, 0});
  EXPECT_TRUE(range.turns);
  EXPECT_NEAR(range.max_radius, r, 1e-9);
  EXPECT_NEAR(range.max_angle, std::atan(2.0 / 3 * r / 500), 1e-12);
}

TEST(LensRange, PlainFisheye_SeesAllAround) {
  const LensRange range = lens_range(EquidistantLens{{300}});
  EXPECT_FALSE(range.turns);
  EXPECT_DOUBLE_EQ(range.max_angle, kPi);
  EXPECT_DOUBLE_EQ(range.max_radius, 300 * kPi);
}

TEST(LensRange, FisheyeThatTurns_EndsThere) {
  // r = 300 a - 50 a^2 turns at a = 3.
  const LensRange range = lens_range(EquidistantLens{{300, -50}});
  EXPECT_TRUE(range.turns);
  EXPECT_NEAR(range.max_angle, 3, 1e-12);
  EXPECT_NEAR(range.max_radius, 450, 1e-9);
}

TEST(LensRange, KannalaBrandt_UsesOddPowersOnly) {
  // r = f (a - a^3 / 12) turns at a = 2.
  const LensRange range = lens_range(KannalaBrandtLens{300, {-1.0 / 12, 0, 0, 0}});
  EXPECT_NEAR(range.max_angle, 2, 1e-12);
  EXPECT_NEAR(range.max_radius, 300 * (2 - 8.0 / 12), 1e-9);
}

TEST(LensRange, LensThatDoesNotRise_HasNoRange) {
  EXPECT_EQ(lens_range(EquidistantLens{{-300}}).max_angle, 0);
  EXPECT_EQ(lens_range(TsaiLens{0, 0, 0}).max_angle, 0);
}

TEST(LensRadius, OfEveryModel_IsItsFormula) {
  EXPECT_NEAR(lens_radius(RectilinearLens{{400, 0, 30}}, 0.5), 400 * std::tan(0.5) + 30 * std::pow(std::tan(0.5), 3),
              1e-9);
  EXPECT_NEAR(lens_radius(EquidistantLens{{400, 20}}, 2), 880, 1e-9);
  EXPECT_NEAR(lens_radius(KannalaBrandtLens{400, {0.01, 0, 0, 0}}, 2), 400 * 2.08, 1e-9);
  // Tsai: at r = 360 Figure 3's lens has r_ideal = 360 * 1.574...
  const double ideal = 360 * (1 + 2.29e-6 * 360 * 360 + 1.65e-11 * std::pow(360, 4));
  EXPECT_NEAR(lens_radius(TsaiLens{490, 2.29e-6, 1.65e-11}, std::atan(ideal / 490)), 360, 1e-9);
}

TEST(FarthestRadius, OfARectangle_IsItsFarthestCornerWithTheAspectTakenOut) {
  const Region region{0, 0, 720, 480, {}};
  EXPECT_DOUBLE_EQ(farthest_radius(region, 300, 200, 1), std::hypot(420, 280));
  EXPECT_DOUBLE_EQ(farthest_radius(region, 300, 200, 2), std::hypot(420, 140));
}

TEST(FarthestRadius, OfACircleInside_IsDistancePlusRadius) {
  const Region region{0, 0, 1000, 1000, Region::Circle{500, 500, 400}};
  EXPECT_NEAR(farthest_radius(region, 500, 500, 1), 400, 1e-9);
  EXPECT_NEAR(farthest_radius(region, 530, 540, 1), 450, 450 * 3e-6);
}

TEST(FarthestRadius, OfACutCircle_LiesWhereCircleAndRectangleCross) {
  const Region region{0, 0, 1000, 300, Region::Circle{500, 0, 500}};
  // Farthest from (100, 0): the circle meets y = 300 at x = 900, 854.4 away; and y = 0 at x = 1000, 900 away.
  EXPECT_NEAR(farthest_radius(region, 100, 0, 1), 900, 1e-9);
  EXPECT_NEAR(farthest_radius({0, 100, 1000, 300, region.circle}, 100, 0, 1),
              std::hypot(500 + std::sqrt(240000.0) - 100, 100), 1e-9);
}

}  // namespace
}  // namespace nodal
