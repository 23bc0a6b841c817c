// Detection of the heads of a rendered rig that have moved since calibration.
#include "stitch/registration/drift.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>

#include "stitch/geometry/rotation.h"
#include "tests/support/rendered_rig.h"

namespace nodal::registration {
namespace {

constexpr int kSide = 200;
constexpr double kPixelsADegree = kSide / 130.0;

/// Rotates the head about its own axes: up, right, clockwise.
void bump(HeadCalibration& head, double up_deg, double right_deg, double roll_deg) {
  const Eigen::Vector3d about = Eigen::Vector3d(up_deg, right_deg, roll_deg) * std::numbers::pi / 180;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(head.R_head_rig.data());
  R = (geometry::rotation_about(about).transpose() * R).eval();
}

test::RenderedRig filmed(const Calibration& truth, std::uint64_t seed = 5) {
  return test::render_rig(truth, hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, seed, 3});
}

const Calibration& calibrated() {
  static const Calibration rig = test::six_fisheyes(kSide);
  return rig;
}

/// The calibrated rig, unmoved.
const test::RenderedRig& still() {
  static const test::RenderedRig rig = filmed(calibrated());
  return rig;
}

TEST(Drift, NothingMoved_EveryHeadStandsAndItsErrorIsWhatItSays) {
  const auto drift = measure_drift(calibrated(), {still().frames()}, {});
  ASSERT_TRUE(drift) << drift.error().text();
  for (const HeadDrift& head : drift->heads) {
    EXPECT_EQ(head.standing, Standing::kStands) << head.name << ": " << head.why;
    EXPECT_LT(head.moved_px, 0.02) << head.name;
    EXPECT_GT(head.sigma_deg, 0) << head.name;
    EXPECT_LT(head.sigma_px, 0.04) << head.name;
  }
  EXPECT_FALSE(drift->any(Standing::kMoved));
}

TEST(Drift, OneHeadBumped_ItAloneIsNamedWithItsWayAndTheOthersDoNotTurn) {
  for (const std::size_t which : {std::size_t{0}, std::size_t{3}}) {
    Calibration truth = calibrated();
    bump(truth.heads[which], 0.2, -0.3, 0.1);
    const auto rig = filmed(truth);
    DriftOptions options;
    options.tolerance_px = 0.2;
    const auto drift = measure_drift(calibrated(), {rig.frames()}, options);
    ASSERT_TRUE(drift) << drift.error().text();
    for (std::size_t h = 0; h < drift->heads.size(); ++h) {
      const HeadDrift& head = drift->heads[h];
      if (h != which) {
        EXPECT_EQ(head.standing, Standing::kStands) << head.name << " " << head.moved_deg << " " << head.why;
        EXPECT_LT(head.moved_px, 0.03) << head.name;
        continue;
      }
      EXPECT_EQ(head.standing, Standing::kMoved) << head.name;
      EXPECT_NEAR(head.up_deg, 0.2, 0.01);
      EXPECT_NEAR(head.right_deg, -0.3, 0.01);
      EXPECT_NEAR(head.roll_deg, 0.1, 0.01);
      EXPECT_NEAR(head.moved_deg, std::sqrt(0.14), 0.01);
      EXPECT_NEAR(head.moved_px, head.moved_deg * kPixelsADegree, 0.02);
    }
  }
}

/// No frame determines a ten-thousandth of a pixel; half a degree is certain all the same.
TEST(Drift, TheToleranceIsFinerThanTheMeasurement_WhatMovedFarIsNamedAndTheRestIsUnknown) {
  Calibration truth = calibrated();
  bump(truth.heads[2], 0.5, 0, 0);
  const auto rig = filmed(truth);
  DriftOptions options;
  options.tolerance_px = 0.0001;
  const auto drift = measure_drift(calibrated(), {rig.frames()}, options);
  ASSERT_TRUE(drift) << drift.error().text();
  for (std::size_t h = 0; h < drift->heads.size(); ++h) {
    EXPECT_EQ(drift->heads[h].standing, h == 2 ? Standing::kMoved : Standing::kUnknown) << h;
  }
}

TEST(Drift, AHeadThatSeesNothing_IsUnknownAndSaysWhyAndTheRestIsJudged) {
  Calibration truth = calibrated();
  bump(truth.heads[1], 0, 0.4, 0);
  test::RenderedRig rig = filmed(truth);
  std::ranges::fill(rig.bytes[4], std::uint8_t{140});
  const auto drift = measure_drift(calibrated(), {rig.frames()}, {});
  ASSERT_TRUE(drift) << drift.error().text();
  EXPECT_EQ(drift->heads[4].standing, Standing::kUnknown);
  EXPECT_NE(drift->heads[4].why.find("no detail"), std::string::npos) << drift->heads[4].why;
  EXPECT_EQ(drift->heads[1].standing, Standing::kMoved);
  for (const std::size_t h : {0u, 2u, 3u, 5u}) EXPECT_EQ(drift->heads[h].standing, Standing::kStands) << h;
}

TEST(Objectives, TheTruthAndABumpedRigOnTheSameFrames_TheTruthLeavesLessAndGainsDecideNothing) {
  Calibration bumped = calibrated(), louder = calibrated();
  bump(bumped.heads[2], 0, 0.3, 0);
  louder.heads[5].gain = {1.3, 1.3, 1.3};
  const auto objectives = objectives_of({calibrated(), bumped, louder}, {still().frames()}, {});
  ASSERT_TRUE(objectives) << objectives.error().text();
  EXPECT_LT((*objectives)[0], 0.8 * (*objectives)[1]);
  EXPECT_NEAR((*objectives)[2] / (*objectives)[0], 1, 0.02);
}

TEST(Objectives, FramesOfAnotherSize_AreRefusedByHead) {
  Calibration other = calibrated();
  other.heads[1].width += 2;
  const auto objectives = objectives_of({calibrated(), other}, {still().frames()}, {});
  ASSERT_FALSE(objectives);
  EXPECT_EQ(objectives.error().code, Errc::kBadValue);
  EXPECT_NE(objectives.error().message.find(other.heads[1].name), std::string::npos);
}

}  // namespace
}  // namespace nodal::registration
