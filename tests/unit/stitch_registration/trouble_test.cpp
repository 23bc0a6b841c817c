// Frames that cannot be registered completely: which heads are named, what is kept, which messages are given.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "stitch/registration/registration.h"
#include "tests/support/rendered_rig.h"

namespace nodal::registration {
namespace {

constexpr int kTroubleSide = 160;
constexpr double kTroublePixelDeg = 130.0 / kTroubleSide;

const test::RenderedRig& trouble_town() {
  static const test::RenderedRig rig = test::render_rig(
      test::six_fisheyes(kTroubleSide), hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 3});
  return rig;
}

void expect_refused(const Calibration& prior, const test::RenderedRig& rig, Errc code, const std::string& says) {
  const Result<Report> report = register_heads(prior, {rig.frames()}, {});
  ASSERT_FALSE(report) << "a calibration that looks fine";
  EXPECT_EQ(report.error().code, code) << report.error().text();
  EXPECT_NE(report.error().message.find(says), std::string::npos) << report.error().text();
}

void fill_with_noise(std::vector<std::uint8_t>& picture, double mean, double sigma, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> level(mean, sigma);
  for (std::uint8_t& pixel : picture) pixel = static_cast<std::uint8_t>(std::clamp(level(random), 0.0, 255.0));
}

TEST(Register, HeadsFarFromThePrior_AreFoundWithoutPairs) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Calibration prior = test::turned(trouble_town().truth, 8, 20, seed);
    const Result<Report> report = register_heads(prior, {trouble_town().frames()}, {});
    ASSERT_TRUE(report) << "seed " << seed << ": " << report.error().text();
    EXPECT_LT(test::rotation_error(trouble_town().truth, report->calibration).rms_deg, 0.01 * kTroublePixelDeg)
        << "seed " << seed;
  }
}

TEST(Register, HeadWithoutDetail_IsNamedAndKeptAtThePriorWhileTheOthersAreFound) {
  test::RenderedRig rig = trouble_town();
  fill_with_noise(rig.bytes[4], 140, 1.0, 9);
  const Calibration prior = test::turned(rig.truth, 1, 3, 4);
  const Result<Report> report = register_heads(prior, {rig.frames()}, {});
  ASSERT_TRUE(report) << report.error().text();
  std::vector<bool> counted(6, true);
  counted[4] = false;
  EXPECT_LT(test::rotation_error(rig.truth, report->calibration, counted).rms_deg, 0.01 * kTroublePixelDeg);
  EXPECT_FALSE(report->heads[4].placed);
  EXPECT_NE(report->heads[4].why_not.find("no detail"), std::string::npos) << report->heads[4].why_not;
  EXPECT_EQ(report->calibration.heads[4].R_head_rig, prior.heads[4].R_head_rig);
  EXPECT_GT(report->heads[4].sigma_deg, 1) << "what the frames say of it is nothing";
  ASSERT_EQ(report->warnings.size(), 1u);
  EXPECT_NE(report->warnings[0].find("'cam4'"), std::string::npos);
}

TEST(Register, BlackFrame_NamesTheHeadAndWhatToTry) {
  test::RenderedRig rig = trouble_town();
  std::ranges::fill(rig.bytes[2], std::uint8_t{2});
  expect_refused(rig.truth, rig, Errc::kNotDetermined, "head 'cam2' is black; take its lens cap off");
}

TEST(Register, OnePictureForTwoHeads_NamesBoth) {
  test::RenderedRig rig = trouble_town();
  rig.bytes[5] = rig.bytes[3];
  expect_refused(rig.truth, rig, Errc::kHeadMismatch, "heads 'cam3' and 'cam5' have the same picture");
}

TEST(Register, AHeadUpsideDown_IsNamed) {
  test::RenderedRig rig = trouble_town();
  std::ranges::reverse(rig.bytes[1]);
  expect_refused(test::turned(rig.truth, 0.5, 1.5, 3), rig, Errc::kHeadMismatch, "head 'cam1' is upside down");
}

TEST(Register, AHeadThatFilmedSomethingElse_IsLeftOutAndNamedWhileTheOthersAreFound) {
  test::RenderedRig rig = trouble_town();
  rig.bytes[2] =
      test::render_rig(rig.truth, hal::sim::town_square_scene(77), {PixelFormat::kGrey8, 1.0, 5, 3}).bytes[5];
  const Calibration prior = test::turned(rig.truth, 0.5, 1.5, 3);
  const Result<Report> report = register_heads(prior, {rig.frames()}, {});
  ASSERT_TRUE(report) << report.error().text();
  std::vector<bool> counted(6, true);
  counted[2] = false;
  EXPECT_LT(test::rotation_error(rig.truth, report->calibration, counted).rms_deg, 0.02 * kTroublePixelDeg);
  EXPECT_FALSE(report->heads[2].placed);
  EXPECT_NE(report->heads[2].why_not.find("see different things"), std::string::npos) << report->heads[2].why_not;
  EXPECT_NE(report->heads[2].why_not.find("(their detail correlates by "), std::string::npos) << "with its size";
  EXPECT_EQ(report->calibration.heads[2].R_head_rig, prior.heads[2].R_head_rig);
  ASSERT_FALSE(report->warnings.empty());
  EXPECT_NE(report->warnings[0].find("'cam2'"), std::string::npos) << report->warnings[0];
}

/// The mean over `reach` pixels on all sides.
std::vector<std::uint8_t> blurred(const std::vector<std::uint8_t>& picture, int reach) {
  std::vector<std::uint8_t> result;
  for (int y = 0; y < kTroubleSide; ++y) {
    for (int x = 0; x < kTroubleSide; ++x) {
      int sum = 0, count = 0;
      for (int j = std::max(0, y - reach); j <= std::min(kTroubleSide - 1, y + reach); ++j) {
        for (int i = std::max(0, x - reach); i <= std::min(kTroubleSide - 1, x + reach); ++i, ++count) {
          sum += picture[static_cast<std::size_t>(j * kTroubleSide + i)];
        }
      }
      result.push_back(static_cast<std::uint8_t>(sum / count));
    }
  }
  return result;
}

TEST(Register, TheFirstHeadIsNotPlaced_TheSecondHoldsTheRig) {
  // Out of focus: the first head has some detail, holds the rig at first, and is given up later.
  bool given_up_late = false;
  for (const int reach : {12, 20}) {
    test::RenderedRig rig = trouble_town();
    rig.bytes[0] = blurred(rig.bytes[0], reach);
    const Calibration prior = test::turned(rig.truth, 1, 3, 4);
    const Result<Report> report = register_heads(prior, {rig.frames()}, {});
    ASSERT_TRUE(report) << report.error().text();
    if (report->heads[0].placed) continue;
    given_up_late = given_up_late || report->heads[0].why_not.find("no detail") == std::string::npos;
    for (std::size_t k = 0; k < 9; ++k) {
      EXPECT_NEAR(report->calibration.heads[1].R_head_rig[k], prior.heads[1].R_head_rig[k], 1e-12) << reach;
    }
    std::vector<bool> counted(6, true);
    counted[0] = false;
    EXPECT_LT(test::rotation_error(rig.truth, report->calibration, counted).rms_deg, 0.02 * kTroublePixelDeg) << reach;
  }
  EXPECT_TRUE(given_up_late) << "or this test shows nothing";
}

/// The largest error of a head's rotation relative to the first head, over its claimed standard deviation.
double worst_ratio(const Calibration& truth, const Report& report) {
  double worst = 0;
  for (std::size_t h = 1; h < truth.heads.size(); ++h) {
    std::vector<bool> counted(truth.heads.size(), false);
    counted[0] = counted[h] = true;
    // Two heads: their mean error is half of their relative one.
    const double error = 2 * test::rotation_error(truth, report.calibration, counted).max_deg;
    worst = std::max(worst, error / report.heads[h].sigma_deg);
  }
  return worst;
}

TEST(Register, LensesALittleWrong_TheClaimedUncertaintyIsThatOfTheResult) {
  for (const double percent : {0.0, 0.3, 0.7}) {
    Calibration prior = test::turned(trouble_town().truth, 1, 3, 6);
    for (HeadCalibration& head : prior.heads) std::get<EquidistantLens>(head.lens).coefficients[0] *= 1 + percent / 100;
    const Result<Report> report = register_heads(prior, {trouble_town().frames()}, {});
    ASSERT_TRUE(report) << report.error().text();
    EXPECT_LT(worst_ratio(trouble_town().truth, *report), 3) << percent;
  }
}

TEST(Register, MirroredPictures_AreRefused) {
  test::RenderedRig rig = trouble_town();
  for (auto& picture : rig.bytes) {
    for (int row = 0; row < kTroubleSide; ++row)
      std::reverse(picture.begin() + row * kTroubleSide, picture.begin() + (row + 1) * kTroubleSide);
  }
  expect_refused(test::turned(rig.truth, 0.5, 1.5, 3), rig, Errc::kHeadMismatch,
                 "the pictures of all heads are mirrored");
}

TEST(Register, SixteenHeadsOfNoise_AreRefused) {
  constexpr int kSmall = 96;
  test::RenderedRig rig;
  rig.truth = test::six_fisheyes(kSmall);
  for (int h = 6; h < 16; ++h) {
    HeadCalibration head =
        test::turned(rig.truth, 10, 40, static_cast<std::uint64_t>(h)).heads[static_cast<std::size_t>(h) % 6];
    head.name = "cam" + std::to_string(h);
    rig.truth.heads.push_back(head);
  }
  for (std::uint64_t h = 0; h < 16; ++h) {
    rig.bytes.emplace_back(kSmall * kSmall);
    fill_with_noise(rig.bytes.back(), 128, 40, 100 + h);
  }
  expect_refused(rig.truth, rig, Errc::kHeadMismatch, "nothing in common");
}

TEST(Register, HeadsThatShareNothing_AreToldSo) {
  Calibration truth = test::six_fisheyes(kTroubleSide, 70);
  const test::RenderedRig rig =
      test::render_rig(truth, hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 3});
  expect_refused(truth, rig, Errc::kNoCoverage, "share");
}

TEST(Register, WrongLensModel_IsRefused) {
  // The same field of view at the edge, but another lens law: 20 px different half way.
  Calibration prior = trouble_town().truth;
  for (HeadCalibration& head : prior.heads) {
    const double edge = 65 * std::numbers::pi / 180;
    head.lens = RectilinearLens{{kTroubleSide / 2.0 / std::tan(edge)}};
  }
  expect_refused(prior, trouble_town(), Errc::kHeadMismatch, "lens");
}

TEST(Register, FocalsABitWrongAndNotSought_IsWarnedOf) {
  for (const double percent : {0.0, 0.5, 0.8}) {
    Calibration prior = test::turned(trouble_town().truth, 1, 3, 6);
    for (HeadCalibration& head : prior.heads) std::get<EquidistantLens>(head.lens).coefficients[0] *= 1 + percent / 100;
    const Result<Report> report = register_heads(prior, {trouble_town().frames()}, {});
    ASSERT_TRUE(report) << report.error().text();
    EXPECT_EQ(report->warnings.size(), percent > 0 ? 1u : 0u) << percent;
    for (const std::string& warning : report->warnings) {
      EXPECT_NE(warning.find("focal lengths"), std::string::npos) << warning;
    }
  }
}

TEST(Register, FocalsTwoPercentOffAndNotSought_AreRefusedWithHowFarOffTheyAre) {
  for (const double percent : {2.0, -2.0}) {
    Calibration prior = test::turned(trouble_town().truth, 1, 3, 6);
    for (HeadCalibration& head : prior.heads) std::get<EquidistantLens>(head.lens).coefficients[0] *= 1 + percent / 100;
    const Result<Report> report = register_heads(prior, {trouble_town().frames()}, {});
    ASSERT_FALSE(report) << percent;
    EXPECT_EQ(report.error().code, Errc::kHeadMismatch);
    const std::string says = percent > 0 ? "about 2.0 % too long" : "about 2.0 % too short";
    EXPECT_NE(report.error().message.find(says), std::string::npos) << report.error().message;
    EXPECT_NE(report.error().message.find("estimate the focal lengths, too"), std::string::npos)
        << report.error().message;
  }
}

TEST(Register, FocalsFarOffAndNotSought_AreRefused) {
  Calibration prior = test::turned(trouble_town().truth, 1, 3, 6);
  for (HeadCalibration& head : prior.heads) std::get<EquidistantLens>(head.lens).coefficients[0] *= 1.05;
  expect_refused(prior, trouble_town(), Errc::kHeadMismatch, "% too long");
}

}  // namespace
}  // namespace nodal::registration
