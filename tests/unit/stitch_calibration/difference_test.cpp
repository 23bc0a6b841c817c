#include "stitch/calibration/difference.h"

#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/angles.h"
#include "stitch/geometry/rotation.h"

namespace nodal::calibration {
namespace {

Calibration rig() {
  Calibration calibration;
  calibration.name = "rig";
  for (int i = 0; i < 4; ++i) {
    HeadCalibration head;
    head.name = "head" + std::to_string(i);
    head.width = 640;
    head.height = 480;
    head.center_x = 320;
    head.center_y = 240;
    head.lens = RectilinearLens{{400}};
    head.region = {0, 0, 640, 480, {}};
    head.vignetting = {320, 240, 400, {}};
    head.R_head_rig = geometry::rows_of(geometry::to_R_head_rig({90.0 * i, 0, 0}));
    calibration.heads.push_back(head);
  }
  return calibration;
}

TEST(Difference, SameRig_IsZeroEverywhere) {
  const auto d = difference_of(rig(), rig());
  ASSERT_TRUE(d);
  EXPECT_NEAR(d->rig_turn_deg, 0, 1e-9);
  for (const HeadDifference& head : d->heads) {
    EXPECT_NEAR(head.raw_deg, 0, 1e-9);
    EXPECT_NEAR(head.max_px, 0, 1e-9);
    EXPECT_EQ(head.gain_stops[0], 0);
    EXPECT_EQ(head.vignetting_stops, 0);
    EXPECT_EQ(head.response_levels, 0);
  }
}

TEST(Difference, WholeRigTurned_IsRawOnly) {
  Calibration turned = rig();
  const Eigen::Matrix3d R = geometry::rotation_about({0.1, 0.2, -0.05});
  for (HeadCalibration& head : turned.heads) {
    head.R_head_rig = geometry::rows_of(geometry::matrix_of(head.R_head_rig) * R);
  }
  const auto d = difference_of(rig(), turned);
  ASSERT_TRUE(d);
  const double angle = std::hypot(0.1, 0.2, 0.05) / kRadiansPerDegree;
  EXPECT_NEAR(d->rig_turn_deg, angle, 1e-9);
  for (const HeadDifference& head : d->heads) {
    EXPECT_NEAR(head.raw_deg, angle, 1e-9);
    EXPECT_NEAR(head.turned_deg, 0, 1e-6);
    EXPECT_NEAR(head.max_px, 0, 1e-6);
  }
}

TEST(Difference, OneHeadTurnedByATenthOfADegree_IsToldInDegreesAndPixels) {
  Calibration moved = rig();
  moved.heads[2].R_head_rig = geometry::rows_of(geometry::rotation_about({0, 0, 0.1 * kRadiansPerDegree}) *
                                                geometry::matrix_of(moved.heads[2].R_head_rig));
  const auto d = difference_of(rig(), moved);
  ASSERT_TRUE(d);
  EXPECT_NEAR(d->heads[2].raw_deg, 0.1, 1e-9);
  // The best common rotation removes a quarter of it.
  EXPECT_NEAR(d->heads[2].turned_deg, 0.075, 0.001);
  EXPECT_NEAR(d->heads[0].turned_deg, 0.025, 0.001);
  // A roll of 0.075 degrees moves the corner, 400 px from the centre, by 0.52 px.
  EXPECT_NEAR(d->heads[2].max_px, 400 * 0.075 * kRadiansPerDegree, 0.01);
  EXPECT_NEAR(d->heads[2].lens_max_px, 0, 1e-9);
}

TEST(Difference, LensGainAndVignetting_AreToldInTheirUnits) {
  Calibration other = rig();
  other.heads[1].lens = RectilinearLens{{404}};
  other.heads[3].gain = {2, 1, 1};
  other.heads[0].vignetting.coefficients = {-0.5, 0, 0};
  other.heads[2].response = {Response::Curve::kGamma, 2.0, {}};
  const auto d = difference_of(rig(), other);
  ASSERT_TRUE(d);
  EXPECT_NEAR(d->heads[1].lens_max_px, 4, 1e-6);  // 1 % of the corner's 400 px
  // One stop in one of twelve channels: a twelfth counts as exposure.
  EXPECT_NEAR(d->heads[3].gain_stops[0], 1 - 1.0 / 12, 1e-12);
  EXPECT_NEAR(d->heads[3].gain_stops[1], -1.0 / 12, 1e-12);
  EXPECT_NEAR(d->heads[0].vignetting_stops, 1, 1e-9);         // half the light in the corner
  EXPECT_NEAR(d->heads[2].response_levels, 255 * 0.25, 0.1);  // e - e^2 at one half
}

TEST(Difference, HeadsInAnotherOrder_ArePairedByName) {
  Calibration other = rig();
  std::swap(other.heads[0], other.heads[3]);
  const auto d = difference_of(rig(), other);
  ASSERT_TRUE(d);
  EXPECT_NEAR(d->turned_rms_deg, 0, 1e-6);
  EXPECT_EQ(d->heads[0].other, "head0");
}

TEST(Difference, NothingInCommon_IsRefused) {
  Calibration other = rig();
  other.heads.pop_back();
  for (HeadCalibration& head : other.heads) head.name += "x";
  const auto refused = difference_of(rig(), other);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kHeadMismatch);
  other.heads.push_back(rig().heads[0]);
  EXPECT_TRUE(difference_of(rig(), other));
}

}  // namespace
}  // namespace nodal::calibration
