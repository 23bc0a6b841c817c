// Gains and fall-off of heads that overlap only at their rims: what is determined, and what is not.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stitch/registration/head_state.h"
#include "stitch/registration/observability.h"
#include "stitch/registration/registration.h"
#include "tests/support/rendered_rig.h"

namespace nodal::registration {
namespace {

/// Two fisheyes back to back, each with a field slightly larger than a hemisphere.
Calibration back_to_back(int side = 240, double view_deg = 196) {
  Calibration rig = test::six_fisheyes(side, view_deg);
  rig.heads = {rig.heads[0], rig.heads[0]};
  rig.heads[0].name = "front";
  rig.heads[1].name = "back";
  rig.heads[0].R_head_rig = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  rig.heads[1].R_head_rig = {-1, 0, 0, 0, 1, 0, 0, 0, -1};
  for (HeadCalibration& head : rig.heads) head.region.circle = Region::Circle{side / 2.0, side / 2.0, side / 2.0};
  return rig;
}

std::vector<HeadState> states_of(const Calibration& rig) {
  std::vector<HeadState> states;
  for (const HeadCalibration& head : rig.heads) states.push_back(HeadState::from(head).value());
  return states;
}

TEST(FallOffSeen, RimsOnlyOrHalfTheView_IsTheSpreadOfTheRadiusSquared) {
  // Equidistant, up to 98 degrees: the overlap is from 82 to 98 degrees, (82/98)^2 to 1, evenly over the sphere's band.
  for (const double seen : fall_off_seen(states_of(back_to_back()))) {
    EXPECT_NEAR(seen, 0.9 * (1 - std::pow(82.0 / 98, 2)), 0.03);
  }
  for (const double seen : fall_off_seen(states_of(test::six_fisheyes(160)))) EXPECT_GT(seen, 0.5);
  Calibration one_apart = back_to_back();  // and a third that looks in the first one's direction
  one_apart.heads.push_back(one_apart.heads.front());
  const std::vector<double> seen = fall_off_seen(states_of(one_apart));
  EXPECT_GT(seen[0], 0.85);
  EXPECT_LT(seen[1], 0.3);
  EXPECT_GT(seen[2], 0.85);
}

TEST(LightAlone, TwoFisheyesBackToBackOfUnlikeExposure_TheirGainsAreFoundAndTheyDoNotMove) {
  Calibration truth = back_to_back();
  truth.heads[0].gain = {0.7, 0.7, 0.7};
  truth.heads[1].gain = {1.0, 1.0, 1.0};
  const auto rig = test::render_rig(truth, hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 3});
  Options options;
  options.geometry = false;
  const Result<Report> report = register_heads(back_to_back(), {rig.frames()}, options);
  ASSERT_TRUE(report) << report.error().text();
  const auto& heads = report->calibration.heads;
  EXPECT_NEAR(heads[0].gain[0] / heads[1].gain[0], 0.7, 0.02);
  EXPECT_EQ(heads[0].vignetting.coefficients, (std::array<double, 3>{}));
  for (std::size_t h = 0; h < 2; ++h) {
    EXPECT_NEAR(report->heads[h].turned_deg, 0, 1e-9);
    for (std::size_t k = 0; k < 9; ++k) EXPECT_EQ(heads[h].R_head_rig[k], truth.heads[h].R_head_rig[k]);
  }
  EXPECT_LT(report->objective_after, 0.1 * report->objective_before);
  ASSERT_EQ(report->warnings.size(), 1u);
  EXPECT_NE(report->warnings[0].find("overlap only at the rims"), std::string::npos) << report->warnings[0];
}

TEST(Light, HeadsOfUnlikeFallOff_EachIsFoundAndTheHeadsArePlacedAsWell) {
  Calibration truth = test::six_fisheyes(160);
  for (std::size_t h = 0; h < 6; ++h) {
    HeadCalibration& head = truth.heads[h];
    head.vignetting.coefficients = {h % 2 == 0 ? -0.3 : -0.05, -0.02, 0};
    head.gain = {0.7, 0.7, 0.7};  // nothing saturates
  }
  const auto rig = test::render_rig(truth, hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 3});
  const Calibration prior = test::turned(test::six_fisheyes(160), 1, 3, 3);
  const Result<Report> report = register_heads(prior, {rig.frames()}, {});
  ASSERT_TRUE(report) << report.error().text();
  const auto left = [](const HeadCalibration& head, double r) {
    const double s = std::pow(r / head.vignetting.radius, 2);
    return light_left(head.vignetting.coefficients, s);
  };
  for (std::size_t h = 0; h < 6; ++h) {
    for (const double r : {40.0, 60.0, 78.0}) {
      EXPECT_NEAR(left(report->calibration.heads[h], r), left(truth.heads[h], r), 0.02) << h << " at " << r;
    }
  }
  Options shared;
  shared.vignetting = VignettingModel::kShared;
  const Result<Report> alike = register_heads(prior, {rig.frames()}, shared);
  ASSERT_TRUE(alike) << alike.error().text();
  EXPECT_LT(report->objective_after, 0.5 * alike->objective_after);
  const double pixel_deg = 130.0 / 160;
  EXPECT_LT(test::rotation_error(truth, report->calibration).rms_deg, 0.01 * pixel_deg);
}

TEST(Light, AFallOffBeyondWhatACalibrationMayHave_IsHeldThere) {
  const Calibration truth = test::six_fisheyes(160);
  auto rig = test::render_rig(truth, hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 0.5, 5, 3});
  // A fall-off that leaves nothing from 77 px on; the rim is at 80 px.
  constexpr double kRadius = 60;
  for (auto& picture : rig.bytes) {
    for (int y = 0; y < 160; ++y) {
      for (int x = 0; x < 160; ++x) {
        const double s = (std::pow(x + 0.5 - 80, 2) + std::pow(y + 0.5 - 80, 2)) / (kRadius * kRadius);
        std::uint8_t& level = picture[static_cast<std::size_t>(160 * y + x)];
        level = static_cast<std::uint8_t>(std::lround(level * std::max(0.0, 1 - 0.6 * s)));
      }
    }
  }
  Calibration prior = truth;
  for (HeadCalibration& head : prior.heads) head.vignetting = {80, 80, kRadius, {-0.3, 0, 0}};
  Options options;
  options.geometry = false;
  const Result<Report> report = register_heads(prior, {rig.frames()}, options);
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_TRUE(check_calibration(report->calibration));
  EXPECT_TRUE(std::ranges::any_of(report->warnings, [](const std::string& warning) {
    return warning.find("held at the limit") != std::string::npos;
  }));
  EXPECT_LT(report->objective_after, report->objective_before);
}

TEST(Moved, AFallOffThatRunsAway_IsStoppedBeforeItsRimIsBlackOrBrighterThanItsMiddle) {
  const HeadState head = states_of(back_to_back()).front();
  Sought sought;
  const Slots slots = slots_of(sought, 1);
  for (const double absurd : {-40.0, 40.0}) {
    Eigen::VectorXd step = Eigen::VectorXd::Zero(slots.count);
    step[slots.vignetting] = absurd;
    const HeadState next = moved(head, slots, step);
    const double rim = 1 + next.vignetting[0] + next.vignetting[1];
    EXPECT_GE(rim, 0.05);
    EXPECT_LE(rim, 1.01);
    if (absurd < 0) {
      EXPECT_LT(rim, 1) << "as far as it may go, not refused";
    }
  }
}

}  // namespace
}  // namespace nodal::registration
