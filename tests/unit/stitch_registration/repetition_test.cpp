// Scenes in which things repeat: heads agree one tile off, too.
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <string>

#include "stitch/geometry/rotation.h"
#include "stitch/registration/registration.h"
#include "tests/support/rendered_rig.h"
#include "tests/support/rigs.h"

namespace nodal::registration {
namespace {

constexpr int kPairSide = 480;
constexpr double kPairViewDeg = 205;

/// Two fisheyes back to back; the second is turned from there, degrees.
Calibration back_to_back(double yaw_deg, double pitch_deg, double roll_deg) {
  constexpr double kEdge = kPairViewDeg / 2 * std::numbers::pi / 180, kRadius = 0.48 * kPairSide;
  Calibration rig;
  rig.name = "pair";
  for (int h = 0; h < 2; ++h) {
    HeadCalibration head = test::plain_head("cam" + std::to_string(h), kPairSide, kPairSide);
    head.lens = EquidistantLens{{kRadius / kEdge}};
    head.max_angle = kEdge;
    head.region.circle = Region::Circle{head.center_x, head.center_y, kRadius - 0.5};
    head.vignetting = {head.center_x, head.center_y, kRadius, {}};
    const geometry::YawPitchRoll turned{180 + yaw_deg, pitch_deg, roll_deg};
    head.R_head_rig = geometry::rows_of(geometry::to_R_head_rig(h == 0 ? geometry::YawPitchRoll{} : turned));
    rig.heads.push_back(head);
  }
  return rig;
}

bool warns_of_repetition(const Report& report) {
  return std::ranges::any_of(report.warnings,
                             [](const std::string& each) { return each.starts_with("things repeat"); });
}

Result<Report> registered(const Calibration& truth, const Calibration& prior, const hal::sim::ScenePtr& scene) {
  Calibration lit = truth;  // unequal light leads the coarsest pictures astray
  lit.heads[0].vignetting.coefficients = {-0.12, 0, 0};
  lit.heads[1].gain.fill(1.04);
  const test::RenderedRig rig = test::render_rig(lit, scene, {PixelFormat::kGrey8, 1.0, 5, 2});
  return register_heads(prior, {rig.frames()}, {});
}

TEST(RegisterRepetition, TheLightBetweenTiles_DecidesWhichIsRight) {
  const Calibration prior = back_to_back(0, 0, 0);
  for (const double turn : {-1.5, 1.5, 3.0, 12.0}) {
    const Calibration truth = back_to_back(turn, -0.7, 0.8);
    const Result<Report> report = registered(truth, prior, test::tiles_scene());
    ASSERT_TRUE(report) << report.error().text();
    EXPECT_LT(test::rotation_error(truth, report->calibration).max_deg, 0.1) << turn << " degrees";
    EXPECT_FALSE(warns_of_repetition(*report)) << "light excludes the tile that is 20 degrees away";
  }
}

TEST(RegisterRepetition, TilesThatAreAllAlike_ThePriorDecides) {
  for (const double turn : {-3.0, 2.0}) {
    const Calibration truth = back_to_back(turn, -0.7, 0.8);
    const Result<Report> report = registered(truth, back_to_back(0, 0, 0), test::tiles_scene(0));
    ASSERT_TRUE(report) << report.error().text();
    EXPECT_LT(test::rotation_error(truth, report->calibration).max_deg, 0.1) << turn << " degrees";
    EXPECT_FALSE(warns_of_repetition(*report)) << "the tile that is 20 degrees away is excluded by the prior";
  }
}

TEST(RegisterRepetition, APriorBetweenTwoTiles_TheOtherOneIsSaidToBePossible) {
  const Calibration truth = back_to_back(10, 0, 0);
  const Result<Report> report = registered(truth, back_to_back(0, 0, 0), test::tiles_scene(0));
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_TRUE(warns_of_repetition(*report))
      << "off by " << test::rotation_error(truth, report->calibration).max_deg << " degrees";
}

TEST(RegisterRepetition, ASceneInWhichNothingRepeats_IsNotSuspected) {
  const Calibration truth = back_to_back(10, 0, 0);
  for (const std::uint64_t seed : {3, 4}) {
    const Result<Report> report = registered(truth, back_to_back(0, 0, 0), hal::sim::town_square_scene(seed));
    ASSERT_TRUE(report) << report.error().text();
    EXPECT_LT(test::rotation_error(truth, report->calibration).max_deg, 0.1);
    EXPECT_FALSE(warns_of_repetition(*report));
  }
}

}  // namespace
}  // namespace nodal::registration
