// Complete registrations of small rendered rigs.
#include "stitch/registration/registration.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>

#include "stitch/geometry/rotation.h"
#include "tests/support/rendered_rig.h"

namespace nodal::registration {
namespace {

constexpr double kRegisterPixelDeg = 130.0 / 160;  // size of a pixel of six_fisheyes(160)

const test::RenderedRig& town() {
  static const test::RenderedRig rig = [] {
    Calibration truth = test::six_fisheyes(160);
    for (std::size_t h = 0; h < truth.heads.size(); ++h) {
      const double gain = 1 + 0.06 * (static_cast<double>(h) - 2.5);
      truth.heads[h].gain = {gain, gain, gain};
      truth.heads[h].vignetting.coefficients = {-0.2, -0.05, 0};
    }
    return test::render_rig(truth, hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 3});
  }();
  return rig;
}

Calibration plain_prior(const Calibration& truth) {
  Calibration prior = truth;
  for (HeadCalibration& head : prior.heads) {
    head.gain = {1, 1, 1};
    head.vignetting.coefficients = {};
  }
  return prior;
}

TEST(Register, HeadsTurnedByDegrees_StandToAFractionOfAPixelAndTheirLightIsFound) {
  const Calibration prior = test::turned(plain_prior(town().truth), 2, 5, 1);
  const Result<Report> report = register_heads(prior, {town().frames()}, {});
  ASSERT_TRUE(report) << report.error().text();
  const test::RotationError error = test::rotation_error(town().truth, report->calibration);
  EXPECT_LT(error.rms_deg, 0.01 * kRegisterPixelDeg);
  EXPECT_LT(report->objective_after, 0.02 * report->objective_before);
  for (std::size_t h = 0; h < 6; ++h) {
    EXPECT_TRUE(report->heads[h].placed);
    EXPECT_LT(report->heads[h].sigma_deg, 0.04 * kRegisterPixelDeg);
    // Gains are relative to their geometric mean; the truth's is 0.989.
    EXPECT_NEAR(report->calibration.heads[h].gain[0] / town().truth.heads[h].gain[0], 1 / 0.9886, 0.01);
  }
}

TEST(Register, AnObjectFixedToOneHead_TurnsItUnlessItIsMasked) {
  // A striped board in the overlap of head 0 and its right neighbour: as sharp as the scene, but not part of it.
  Calibration truth = town().truth;
  std::vector<std::uint8_t> painted;
  std::vector<ImageView> frames = town().frames();
  const ImageView clean = frames[0];
  for (int y = 0; y < clean.height; ++y) {
    const std::uint8_t* row = clean.planes[0].data + y * clean.planes[0].row_stride;
    painted.insert(painted.end(), row, row + clean.width);
  }
  for (int y = 45; y < 115; ++y) {
    for (int x = 104; x < 152; ++x)
      painted[static_cast<std::size_t>(y * clean.width + x)] = (x / 3 + y / 5) % 2 == 0 ? 20 : 235;
  }
  frames[0] = packed_image(clean.format, clean.width, clean.height, std::as_const(painted).data());
  const auto error_with = [&](const std::vector<std::vector<Region::Point>>& masks) {
    Calibration prior = test::turned(plain_prior(truth), 1, 2, 1);
    prior.heads[0].region.masks = masks;
    const Result<Report> report = register_heads(prior, {frames}, {});
    EXPECT_TRUE(report) << (report ? "" : report.error().text());
    if (!report) return 1e9;
    EXPECT_EQ(report->calibration.heads[0].region.masks, masks) << "the result keeps them";
    return test::rotation_error(truth, report->calibration).rms_deg;
  };
  const double masked = error_with({{{103, 44}, {153, 44}, {153, 116}, {103, 116}}});
  const double plain = error_with({});
  std::printf("board in front of a head: rms %.4f degrees, masked %.4f\n", plain, masked);
  EXPECT_LT(masked, 0.02 * kRegisterPixelDeg);
  EXPECT_GT(plain, 2 * masked);
}

TEST(Register, OneThreadOrThree_TheSameBytes) {
  const Calibration prior = test::turned(plain_prior(town().truth), 1, 3, 2);
  std::vector<std::string> documents;
  for (const int threads : {1, 2, 3}) {
    Options options;
    options.threads = threads;
    const Result<Report> report = register_heads(prior, {town().frames()}, options);
    ASSERT_TRUE(report) << report.error().text();
    documents.push_back(canonical_json(report->calibration));
  }
  EXPECT_EQ(documents[0], documents[1]);
  EXPECT_EQ(documents[0], documents[2]);
}

TEST(Register, FocalsTooWrong_BothAreFound) {
  Calibration prior = test::turned(plain_prior(town().truth), 1, 3, 3);
  double sign = 1;
  for (HeadCalibration& head : prior.heads) {
    std::get<EquidistantLens>(head.lens).coefficients[0] *= 1 + 0.015 * sign;
    sign = -sign;
  }
  Options options;
  options.free = Free::kFocals;
  const Result<Report> report = register_heads(prior, {town().frames()}, options);
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_LT(test::rotation_error(town().truth, report->calibration).rms_deg, 0.02 * kRegisterPixelDeg);
  for (std::size_t h = 0; h < 6; ++h) {
    const double truth = std::get<EquidistantLens>(town().truth.heads[h].lens).coefficients[0];
    EXPECT_NEAR(std::get<EquidistantLens>(report->calibration.heads[h].lens).coefficients[0] / truth, 1, 5e-4);
  }
}

TEST(Register, PixelsThatAreNotSquare_OneAspectIsFoundForAllHeads) {
  Calibration prior = test::turned(plain_prior(town().truth), 1, 3, 3);
  for (HeadCalibration& head : prior.heads) head.aspect = 1.006;  // the truth's is 1
  Options options;
  options.aspect = true;
  const Result<Report> report = register_heads(prior, {town().frames()}, options);
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_LT(test::rotation_error(town().truth, report->calibration).rms_deg, 0.02 * kRegisterPixelDeg);
  for (const HeadCalibration& head : report->calibration.heads) EXPECT_NEAR(head.aspect, 1, 2e-4);
  options.aspect = false;
  const Result<Report> held = register_heads(prior, {town().frames()}, options);
  ASSERT_TRUE(held) << held.error().text();
  EXPECT_EQ(held->calibration.heads.front().aspect, 1.006);
  EXPECT_LT(report->objective_after, 0.5 * held->objective_after);
}

TEST(Register, EveryLayoutAndNorm_FindsTheRigAndTheResultDependsOnTheLayoutABit) {
  const Calibration prior = test::turned(plain_prior(town().truth), 1, 3, 4);
  std::vector<Calibration> found;
  for (const char* layout : {"equirectangular", "cube"}) {
    for (const Norm norm : {Norm::kSum, Norm::kMax}) {
      Options options;
      options.layout = layout;
      options.norm = norm;
      const Result<Report> report = register_heads(prior, {town().frames()}, options);
      ASSERT_TRUE(report) << layout << ": " << report.error().text();
      EXPECT_LT(test::rotation_error(town().truth, report->calibration).rms_deg, 0.01 * kRegisterPixelDeg) << layout;
      found.push_back(report->calibration);
    }
  }
  EXPECT_GT(test::rotation_error(found[0], found[2]).max_deg, 1e-6);
}

TEST(Register, ARaymapNarrowerThanThePictures_PlacesTheHeadsAsWellAsItShows) {
  const Calibration prior = test::turned(plain_prior(town().truth), 1, 3, 6);
  for (const int width : {96, 128, 160}) {
    Options options;
    options.width = width;
    const Result<Report> report = register_heads(prior, {town().frames()}, options);
    EXPECT_TRUE(report) << width << ": " << report.error().text();
    if (!report) continue;
    EXPECT_LT(test::rotation_error(town().truth, report->calibration).rms_deg, 0.1 * 360 / width) << width;
    for (const HeadReport& head : report->heads) EXPECT_TRUE(head.placed) << width << ": " << head.why_not;
  }
}

TEST(Register, FirstHeadHoldsTheRig_ItStaysAsThePriorHasIt) {
  const Calibration prior = test::turned(plain_prior(town().truth), 1, 3, 5);
  const Result<Report> report = register_heads(prior, {town().frames()}, {});
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_EQ(report->heads[0].turned_deg, 0);
  for (std::size_t k = 0; k < 9; ++k) {
    EXPECT_NEAR(report->calibration.heads[0].R_head_rig[k], prior.heads[0].R_head_rig[k], 1e-12);
  }
}

TEST(Register, MeanGauge_TurnsOfAllHeadsHaveMeanZeroAndNoneIsKnownExactly) {
  const Calibration prior = test::turned(plain_prior(town().truth), 1, 3, 5);
  Options options;
  options.gauge = Gauge::kMean;
  const Result<Report> report = register_heads(prior, {town().frames()}, options);
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_LT(test::rotation_error(town().truth, report->calibration).rms_deg, 0.01 * kRegisterPixelDeg);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t h = 0; h < 6; ++h) {
    const Eigen::AngleAxisd turn(geometry::matrix_of(report->calibration.heads[h].R_head_rig).transpose() *
                                 geometry::matrix_of(prior.heads[h].R_head_rig));
    sum += turn.angle() * turn.axis();
    EXPECT_GT(report->heads[h].turned_deg, 0.1);
    EXPECT_GT(report->heads[h].sigma_deg, 0);
  }
  EXPECT_LT(sum.norm(), 1e-9);
}

TEST(Register, FogInOneFrameSet_IsRegisteredByTheOther) {
  const test::RenderedRig fog =
      test::render_rig(town().truth, hal::sim::constant_scene({0.5F, 0.5F, 0.5F}), {PixelFormat::kGrey8, 1.0, 6, 3});
  const Calibration prior = test::turned(plain_prior(town().truth), 2, 4, 7);
  const Result<Report> alone = register_heads(prior, {fog.frames()}, {});
  ASSERT_FALSE(alone);
  EXPECT_EQ(alone.error().code, Errc::kNoCoverage) << alone.error().text();
  const Result<Report> both = register_heads(prior, {fog.frames(), town().frames()}, {});
  ASSERT_TRUE(both) << both.error().text();
  EXPECT_LT(test::rotation_error(town().truth, both->calibration).rms_deg, 0.02 * kRegisterPixelDeg);
}

}  // namespace
}  // namespace nodal::registration
