// Rigs filmed by the simulator, whose electronics share no code with the calibration.
#include "stitch/calibration/light/calibrate_light.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stitch/geometry/response.h"
#include "tests/support/rendered_rig.h"

namespace nodal::calibration {
namespace {

constexpr int kSide = 200;

/// Six fisheyes with different gains, a fall-off and a curve.
Calibration lit_rig() {
  Calibration rig = test::six_fisheyes(kSide);
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    HeadCalibration& head = rig.heads[h];
    const double stops = 0.25 * static_cast<double>(h) - 0.625;  // their mean is 0
    head.gain = {std::exp2(stops), std::exp2(-stops / 2), std::exp2(0.8 * stops)};
    head.vignetting.coefficients = {-0.25, 0.05, 0};
    head.response.curve = Response::Curve::kGamma;
    head.response.gamma = 2.2;
  }
  return rig;
}

/// The rig before its light calibration: geometry only, and a linear curve.
Calibration geometry_of(Calibration rig) {
  for (HeadCalibration& head : rig.heads) {
    head.gain = {1, 1, 1};
    head.vignetting.coefficients = {};
    head.response = {};
  }
  return rig;
}

test::RenderedRig film(Calibration rig, double stops, double noise_levels = 1.5, std::uint64_t seed = 9) {
  for (HeadCalibration& head : rig.heads) {
    for (double& gain : head.gain) gain *= std::exp2(stops - 1);  // the town square by day is bright
  }
  return test::render_rig(rig, hal::sim::town_square_scene(4),
                          {.format = PixelFormat::kRgb24, .noise_levels = noise_levels, .seed = seed});
}

double fall_off(const HeadCalibration& head, double px) {
  const double s = std::pow(px / head.vignetting.radius, 2);
  const auto& v = head.vignetting.coefficients;
  return 1 + s * (v[0] + s * (v[1] + s * v[2]));
}

/// Compares gains (stops), and fall-offs where heads overlap.
void expect_light_of(const Calibration& truth, const Calibration& found, double gain_stops, double part) {
  for (std::size_t h = 0; h < truth.heads.size(); ++h) {
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(std::log2(found.heads[h].gain[c] / truth.heads[h].gain[c]), 0, gain_stops)
          << truth.heads[h].name << " channel " << c;
    }
    // Fall-off is determined up to a factor common to all heads in their centres, where no other head looks.
    for (const double px : {0.75, 0.85, 0.95}) {
      const double ours = fall_off(found.heads[h], px * kSide / 2) / fall_off(found.heads[h], 0.7 * kSide / 2);
      const double theirs = fall_off(truth.heads[h], px * kSide / 2) / fall_off(truth.heads[h], 0.7 * kSide / 2);
      EXPECT_NEAR(ours, theirs, part) << truth.heads[h].name << " at " << px;
    }
  }
}

TEST(CalibrateLight, ThreeKnownExposures_GainsFallOffAndResponseComeBack) {
  const Calibration truth = lit_rig();
  const auto dark = film(truth, -1), middle = film(truth, 0), bright = film(truth, 1);
  const auto found = calibrate_light(
      geometry_of(truth),
      {{"dark", dark.frames(), -1.0}, {"middle", middle.frames(), 0.0}, {"bright", bright.frames(), 1.0}}, {});
  ASSERT_TRUE(found) << found.error().text();
  ASSERT_TRUE(found->response_found);
  for (const HeadCalibration& head : found->calibration.heads) {
    ASSERT_EQ(head.response.curve, Response::Curve::kGamma);
    EXPECT_NEAR(head.response.gamma, 2.2, 0.02);
  }
  expect_light_of(truth, found->calibration, 0.02, 0.01);
  EXPECT_LT(found->after_stops, 0.1);
  EXPECT_GT(found->before_stops, 2 * found->after_stops);
  EXPECT_TRUE(found->notes.empty()) << found->notes[0];
}

// A fit of light instead of values multiplies noise by gamma, prefers small ones, and was 0.023 off here.
TEST(CalibrateLight, NoisyPicturesOfNearlyTheSameExposure_GammaIsNotDrawnDown) {
  const Calibration truth = lit_rig();
  const auto dark = film(truth, -0.3, 8, 1000), bright = film(truth, 0.3, 8, 1017);
  const auto found =
      calibrate_light(geometry_of(truth), {{"dark", dark.frames(), -0.3}, {"bright", bright.frames(), 0.3}}, {});
  ASSERT_TRUE(found) << found.error().text();
  for (const HeadCalibration& head : found->calibration.heads) EXPECT_NEAR(head.response.gamma, 2.2, 0.005);
}

TEST(CalibrateLight, ResponseKnown_OneSetGivesGainsAndFallOff) {
  const Calibration truth = lit_rig();
  Calibration prior = geometry_of(truth);
  for (HeadCalibration& head : prior.heads) head.response = truth.heads[0].response;
  const auto frames = film(truth, 0);
  const auto found = calibrate_light(prior, {{"one", frames.frames(), {}}}, {});
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_FALSE(found->response_found);
  EXPECT_EQ(found->calibration.heads[2].response, prior.heads[2].response);
  expect_light_of(truth, found->calibration, 0.02, 0.01);
  for (const HeadLight& head : found->heads) {
    EXPECT_GT(head.shared, 500) << head.name;
    EXPECT_LT(head.sigma_gain_stops[1], 0.02) << head.name;
  }
}

TEST(CalibrateLight, CurveThatIsNoGamma_IsFoundAsAPolynomial) {
  Calibration truth = lit_rig();
  for (HeadCalibration& head : truth.heads) {
    head.response = {};
    head.response.curve = Response::Curve::kPolynomial;
    head.response.coefficients = {0.4, 0, 0, 0.6};
  }
  const auto dark = film(truth, -1), bright = film(truth, 0.5);
  const auto found =
      calibrate_light(geometry_of(truth), {{"dark", dark.frames(), -1.0}, {"bright", bright.frames(), 0.5}}, {});
  ASSERT_TRUE(found) << found.error().text();
  const Response& curve = found->calibration.heads[0].response;
  ASSERT_EQ(curve.curve, Response::Curve::kPolynomial);
  for (const double e : {0.1, 0.3, 0.5, 0.7, 0.9}) {
    EXPECT_NEAR(geometry::decode(curve, e), 0.4 * e + 0.6 * e * e * e * e, 0.01) << e;
  }
}

TEST(CalibrateLight, HeadsOfTwoKinds_EachGetsItsOwnCurveAndFallOff) {
  Calibration truth = lit_rig();
  truth.heads[3].response.gamma = 1.6;
  truth.heads[3].vignetting.coefficients = {-0.5, 0.1, 0};
  const auto dark = film(truth, -1), bright = film(truth, 0);
  const auto found =
      calibrate_light(geometry_of(truth), {{"dark", dark.frames(), -1.0}, {"bright", bright.frames(), 0.0}},
                      {.own_vignetting = true, .own_response = true});
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_NEAR(found->calibration.heads[3].response.gamma, 1.6, 0.03);
  EXPECT_NEAR(found->calibration.heads[1].response.gamma, 2.2, 0.03);
  const auto corner = [](const HeadCalibration& head) { return fall_off(head, 90) / fall_off(head, 70); };
  EXPECT_NEAR(corner(found->calibration.heads[3]), corner(truth.heads[3]), 0.03);
  EXPECT_NEAR(corner(found->calibration.heads[0]), corner(truth.heads[0]), 0.03);
}

TEST(CalibrateLight, HeadThatSharesNothing_KeepsItsGainAndIsNamed) {
  const Calibration truth = lit_rig();
  Calibration prior = geometry_of(truth);
  for (HeadCalibration& head : prior.heads) head.response = truth.heads[0].response;
  prior.heads[4].region.circle = Region::Circle{kSide / 2.0, kSide / 2.0, 30};  // only its centre is usable
  prior.heads[4].gain = {1.1, 1.2, 1.3};
  const auto frames = film(truth, 0);
  const auto found = calibrate_light(prior, {{"one", frames.frames(), {}}}, {});
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_FALSE(found->heads[4].placed);
  EXPECT_EQ(found->calibration.heads[4], prior.heads[4]);
  ASSERT_FALSE(found->notes.empty());
  EXPECT_NE(found->notes[0].find("'cam4' shares too little"), std::string::npos);
  // The other heads are compared with each other.
  const auto apart = [](const Calibration& c) { return std::log2(c.heads[0].gain[1] / c.heads[1].gain[1]); };
  EXPECT_NEAR(apart(found->calibration), apart(truth), 0.02);
}

TEST(CalibrateLight, WhatCannotBe_IsRefusedWithWhatToDo) {
  const Calibration truth = lit_rig();
  const Calibration prior = geometry_of(truth);
  const auto dark = film(truth, -1), bright = film(truth, 0);
  const auto refusal = [&](const std::vector<ExposedSet>& sets) {
    const auto result = calibrate_light(prior, sets, {});
    return result ? std::string("accepted") : result.error().message;
  };
  EXPECT_NE(refusal({}).find("no pictures"), std::string::npos);
  EXPECT_NE(refusal({{"a", dark.frames(), 1.0}, {"b", bright.frames(), 1.0}}).find("alike"), std::string::npos);
  EXPECT_NE(refusal({{"a", dark.frames(), 1.0}, {"b", bright.frames(), -1.0}}).find("do not follow the stops"),
            std::string::npos);
  std::vector<ImageView> five = dark.frames();
  five.pop_back();
  EXPECT_NE(refusal({{"a", five, {}}}).find("a: holds 5 pictures for 6 heads"), std::string::npos);
  std::vector<ImageView> cut = dark.frames();
  cut[2].height -= 10;
  EXPECT_NE(refusal({{"a", cut, {}}}).find("a: the picture of head 'cam2' is 200x190"), std::string::npos);
  const std::vector<std::uint8_t> black(3 * kSide * kSide, 0);
  const std::vector<ImageView> night(6, packed_image(PixelFormat::kRgb24, kSide, kSide, black.data()));
  EXPECT_NE(refusal({{"a", night, {}}}).find("no two heads share"), std::string::npos);
}

}  // namespace
}  // namespace nodal::calibration
