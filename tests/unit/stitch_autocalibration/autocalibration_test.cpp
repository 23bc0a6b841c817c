// A whole rig from its pictures, rendered by the simulator.
#include "stitch/autocalibration/autocalibration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <variant>

#include "stitch/geometry/lens/lens.h"
#include "stitch/geometry/rotation.h"
#include "tests/support/rendered_rig.h"

namespace nodal::autocalibration {
namespace {

std::vector<DecodedImage> pictures_of(const test::RenderedRig& rig) {
  std::vector<DecodedImage> pictures;
  for (std::size_t h = 0; h < rig.bytes.size(); ++h) {
    pictures.push_back({PixelFormat::kGrey8, rig.truth.heads[h].width, rig.truth.heads[h].height, rig.bytes[h]});
  }
  return pictures;
}

std::vector<std::string> names_of(const Calibration& rig) {
  std::vector<std::string> names;
  for (const HeadCalibration& head : rig.heads) names.push_back(head.name);
  return names;
}

TEST(Autocalibration, TownSeenBySixFisheyes_RotationsAndFieldOfView) {
  const test::RenderedRig rig =
      test::render_rig(test::six_fisheyes(500), hal::sim::town_square_scene(3), {.noise_levels = 1});
  const auto found = autocalibrate(pictures_of(rig), names_of(rig.truth), {});
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_EQ(found->placed.size(), 6U);
  EXPECT_LT(test::rotation_error(rig.truth, found->calibration).max_deg, 0.5);
  EXPECT_LT(found->error_px, 1);
  EXPECT_TRUE(check_calibration(found->calibration));
  const auto angle_at_edge = [](const HeadCalibration& head) {
    return *geometry::Lens::make(head.lens).value().angle(0.95 * head.width / 2);
  };
  EXPECT_NEAR(angle_at_edge(found->calibration.heads[0]), angle_at_edge(rig.truth.heads[0]), 0.01);
}

TEST(Autocalibration, TwoFisheyesThatHardlyOverlap_AreBackToBackOrRefused) {
  for (const double view_deg : {186.0, 190.0, 200.0}) {
    Calibration pair = test::six_fisheyes(500, view_deg);
    pair.heads = {pair.heads[0], pair.heads[2]};
    for (HeadCalibration& head : pair.heads) head.region.circle = Region::Circle{250, 250, 249};
    const test::RenderedRig rig = test::render_rig(pair, hal::sim::town_square_scene(1), {.noise_levels = 1});
    std::vector<double> progress;
    Options options;
    options.progress = [&](double done) { progress.push_back(done); };
    const auto found = autocalibrate(pictures_of(rig), names_of(rig.truth), options);
    if (view_deg < 190) {
      EXPECT_GE(std::ranges::count_if(progress, [](double done) { return done > 0.9 && done < 0.99; }), 2)
          << "rims are compared after the whole pictures";
    }
    if (!found) {
      EXPECT_TRUE(found.error().code == Errc::kNoCoverage || found.error().code == Errc::kHeadMismatch)
          << found.error().text();
      continue;
    }
    EXPECT_LT(test::rotation_error(rig.truth, found->calibration).max_deg, 1) << view_deg << ": not both one way";
    const auto lens = geometry::Lens::make(found->calibration.heads[0].lens).value();
    const auto truth = geometry::Lens::make(pair.heads[0].lens).value();
    for (const double angle : {0.2, 0.8, 1.4, 1.6}) {
      EXPECT_NEAR(*lens.radius(angle) / *truth.radius(angle), 1, 0.03) << view_deg << " at " << angle;
    }
    EXPECT_FALSE(found->lens.whole());
  }
}

/// Three fisheyes that look 40 degrees apart, to the right.
Calibration three_to_the_right() {
  Calibration rig = test::six_fisheyes(400);
  rig.heads.resize(3);
  for (std::size_t h = 0; h < 3; ++h) {
    rig.heads[h].R_head_rig = geometry::rows_of(geometry::to_R_head_rig({40.0 * static_cast<double>(h), 0, 0}));
  }
  return rig;
}

TEST(Autocalibration, PicturesThatOverlapAndShowDifferentThings_AreNamed) {
  const Calibration rig = three_to_the_right();
  test::RenderedRig town = test::render_rig(rig, hal::sim::town_square_scene(3), {.noise_levels = 1});
  const test::RenderedRig other = test::render_rig(rig, hal::sim::town_square_scene(8), {.noise_levels = 1});
  // The left part of the last picture, which the first one sees, too, is of another town, which lies on its side.
  for (int y = 0; y < 400; ++y) {
    for (int x = 0; x < 150; ++x) {
      town.bytes[2][static_cast<std::size_t>(y * 400 + x)] = other.bytes[2][static_cast<std::size_t>(x * 400 + y)];
    }
  }
  const auto found = autocalibrate(pictures_of(town), names_of(rig), {});
  ASSERT_TRUE(found) << found.error().text();
  ASSERT_EQ(found->placed.size(), 3U);
  ASSERT_EQ(found->doubtful.size(), 1U);
  EXPECT_EQ(found->doubtful[0], (std::pair<std::size_t, std::size_t>(0, 2)));
}

TEST(Autocalibration, AFalseFocalLengthInExif_DoesNoHarm) {
  const test::RenderedRig rig = test::render_rig(test::six_fisheyes(400), hal::sim::town_square_scene(3), {});
  Options wrong;  // such as from a picture that was cut out of a larger one
  wrong.focal_px.assign(6, 3 * std::get<EquidistantLens>(rig.truth.heads[0].lens).coefficients[0]);
  const auto found = autocalibrate(pictures_of(rig), names_of(rig.truth), wrong);
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_LT(test::rotation_error(rig.truth, found->calibration).max_deg, 0.5);
}

TEST(Autocalibration, AnotherOrderOfThePictures_SameRig) {
  const test::RenderedRig rig = test::render_rig(test::six_fisheyes(400), hal::sim::town_square_scene(3), {});
  std::vector<DecodedImage> pictures = pictures_of(rig);
  std::vector<std::string> names = names_of(rig.truth);
  Calibration truth = rig.truth;
  std::ranges::reverse(pictures);
  std::ranges::reverse(names);
  std::ranges::reverse(truth.heads);
  const auto found = autocalibrate(pictures, names, {});
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_LT(test::rotation_error(truth, found->calibration).max_deg, 0.5);
  EXPECT_EQ(found->calibration.heads.front().name, truth.heads.front().name);
}

TEST(Autocalibration, TheSamePictureTwice_IsRefusedAndNamed) {
  const test::RenderedRig rig = test::render_rig(test::six_fisheyes(300), hal::sim::town_square_scene(3), {});
  std::vector<DecodedImage> pictures = pictures_of(rig);
  pictures[4] = pictures[1];
  const auto all = autocalibrate(pictures, names_of(rig.truth), {});
  ASSERT_FALSE(all);
  EXPECT_EQ(all.error().code, Errc::kHeadMismatch);
  EXPECT_NE(all.error().message.find(rig.truth.heads[4].name), std::string::npos) << all.error().message;
  EXPECT_EQ(autocalibrate({pictures[1], pictures[4]}, {"a", "b"}, {}).error().code, Errc::kHeadMismatch);
}

TEST(Autocalibration, ExtremeShapes_AreRefusedWithoutHarm) {
  for (const auto& [width, height] :
       std::vector<std::pair<int, int>>{{1, 1}, {2, 2}, {32768, 1}, {1, 32768}, {4000, 2}}) {
    DecodedImage picture{PixelFormat::kGrey8, width, height, {}};
    for (int i = 0; i < width * height; ++i) picture.bytes.push_back(static_cast<std::uint8_t>(i * 37));
    EXPECT_FALSE(autocalibrate({picture, picture}, {"a", "b"}, {})) << width << "x" << height;
  }
}

TEST(Autocalibration, TooFewTooManyOrBlackPictures_AreRefused) {
  const DecodedImage black{PixelFormat::kGrey8, 64, 64, std::vector<std::uint8_t>(64 * 64)};
  EXPECT_EQ(autocalibrate({}, {}, {}).error().code, Errc::kBadValue);
  EXPECT_EQ(autocalibrate({black}, {"a"}, {}).error().code, Errc::kBadValue);
  EXPECT_EQ(autocalibrate({black, black}, {"a", "b"}, {}).error().code, Errc::kNoCoverage);
  const std::vector<DecodedImage> many(kMaxPictures + 1, black);
  EXPECT_EQ(autocalibrate(many, std::vector<std::string>(many.size(), "a"), {}).error().code, Errc::kBadValue);
}

}  // namespace
}  // namespace nodal::autocalibration
