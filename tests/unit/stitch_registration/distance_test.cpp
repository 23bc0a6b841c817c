// Registration of rigs whose heads have positions, in rooms.
#include <gtest/gtest.h>

#include <algorithm>

#include "stitch/registration/registration.h"
#include "tests/support/rendered_rig.h"

namespace nodal::registration {
namespace {

constexpr double kPixelDeg = 130.0 / 160;  // size of a pixel of six_fisheyes(160)

const Calibration& spread() {
  static const Calibration rig = test::spread_out(test::six_fisheyes(160), 0.1);
  return rig;
}

test::RenderedRig in_a_room(const test::Room& room) {
  return test::render_rig_in(room, spread(), hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 3});
}

Options with_distance() {
  Options options;
  options.distance = true;
  return options;
}

TEST(RegisterDistance, OfABall_IsFoundWithTheRotations) {
  for (const double radius : {0.6, 2.0, 20.0}) {
    const test::RenderedRig rig = in_a_room({test::Room::Shape::kBall, radius});
    Calibration prior = test::turned(spread(), 1, 2, 1);
    prior.heads[0].R_head_rig = spread().heads[0].R_head_rig;  // the first head is held
    const Result<Report> found = register_heads(prior, {rig.frames()}, with_distance());
    ASSERT_TRUE(found) << found.error().text();
    const double nearness = found->calibration.distance > 0 ? 1 / found->calibration.distance : 0;
    // 0.03 px of parallax; heads are 0.1 m from the nodal point.
    EXPECT_NEAR(nearness, 1 / radius, 0.03 * kPixelDeg / 57.3 / 0.1) << radius;
    EXPECT_GT(found->sigma_nearness, 0);
    EXPECT_LT(found->sigma_nearness, 0.03 * kPixelDeg / 57.3 / 0.1);
    EXPECT_LT(test::rotation_error(spread(), found->calibration).rms_deg, 0.03 * kPixelDeg) << radius;
  }
}

TEST(RegisterDistance, SoNearThatHeadsSeeTheSeams12DegreesApart_IsFound) {
  const test::RenderedRig rig = in_a_room({test::Room::Shape::kBall, 0.45});
  const Result<Report> found = register_heads(spread(), {rig.frames()}, with_distance());
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_NEAR(found->calibration.distance, 0.45, 0.002);
  EXPECT_LT(test::rotation_error(spread(), found->calibration).rms_deg, 0.1 * kPixelDeg);
}

TEST(RegisterDistance, OfPicturesFromOnePoint_IsInfiniteWithinItsUncertainty) {
  const test::RenderedRig rig =
      test::render_rig(spread(), hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 3});
  const Result<Report> found = register_heads(spread(), {rig.frames()}, with_distance());
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_LT(found->calibration.distance > 0 ? 1 / found->calibration.distance : 0, 5 * found->sigma_nearness + 1e-3);
}

TEST(RegisterDistance, GivenAndHeld_RotationsAreThoseOfTheRoom) {
  const test::RenderedRig rig = in_a_room({test::Room::Shape::kBall, 1});
  Calibration prior = test::turned(spread(), 1, 2, 1);
  const Result<Report> without = register_heads(prior, {rig.frames()}, {});
  prior.distance = 1;
  const Result<Report> with = register_heads(prior, {rig.frames()}, {});
  ASSERT_TRUE(with) << with.error().text();
  EXPECT_EQ(with->calibration.distance, 1);
  if (without) {
    EXPECT_LT(with->objective_after, 0.3 * without->objective_after);
  }
}

bool says(const Report& report, const std::string& words) {
  return std::ranges::any_of(report.warnings, [&](const std::string& each) { return each.find(words) != each.npos; });
}

TEST(RegisterDistance, NotAskedForInARoom_IsRecommendedWithTheDistanceAndLensesAreNotBlamed) {
  const test::RenderedRig rig = in_a_room({test::Room::Shape::kBall, 3});
  const Result<Report> near = register_heads(spread(), {rig.frames()}, {});
  ASSERT_TRUE(near) << near.error().text();
  EXPECT_TRUE(says(*near, "--free distance")) << ::testing::PrintToString(near->warnings);
  EXPECT_FALSE(says(*near, "lens"));
  const test::RenderedRig far =
      test::render_rig(spread(), hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 1.0, 5, 3});
  const Result<Report> good = register_heads(spread(), {far.frames()}, {});
  ASSERT_TRUE(good) << good.error().text();
  EXPECT_FALSE(says(*good, "--free distance")) << ::testing::PrintToString(good->warnings);
}

TEST(RegisterDistance, HeadsAtOnePointWithLensesAThirdOfAPixelOff_AreNotSaidToStandElsewhere) {
  const Calibration truth = test::six_fisheyes(200);
  const test::RenderedRig rig =
      test::render_rig(truth, hal::sim::town_square_scene(3), {PixelFormat::kGrey8, 0.3, 5, 3});
  for (const double off_px : {0.1, 0.2, 0.3}) {
    Calibration prior = truth;
    for (HeadCalibration& head : prior.heads) {
      const double focal = std::get<EquidistantLens>(head.lens).coefficients[0];
      head.lens = EquidistantLens{{focal + off_px, 0, -off_px}};  // right at the axis and at 57 degrees from it
    }
    const Result<Report> found = register_heads(prior, {rig.frames()}, {});
    ASSERT_TRUE(found) << found.error().text();
    const bool by_rounding = found->objective_after < 0.25;  // levels squared
    EXPECT_EQ(found->warnings.empty(), by_rounding) << off_px << " px: " << ::testing::PrintToString(found->warnings);
    for (const std::string& warning : found->warnings) {
      EXPECT_NE(warning.find("the lenses may not fit"), std::string::npos) << warning;
      EXPECT_EQ(warning.find("position"), std::string::npos) << warning;
    }
  }
}

TEST(RegisterDistance, InABox_IsThatOfItsWallsInTheOverlaps) {
  const test::RenderedRig rig = in_a_room({test::Room::Shape::kBox, 1});
  const Result<Report> found = register_heads(spread(), {rig.frames()}, with_distance());
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_GT(found->calibration.distance, 1.0);
  EXPECT_LT(found->calibration.distance, 1.74) << "the corners are 1.73 m away";
}

TEST(RegisterDistance, WithoutPositions_IsRefusedWithWhatToDo) {
  const Calibration rig = test::six_fisheyes(160);
  const test::RenderedRig seen = test::render_rig(rig, hal::sim::town_square_scene(3));
  const Result<Report> found = register_heads(rig, {seen.frames()}, with_distance());
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().message.find("position"), std::string::npos);
}

}  // namespace
}  // namespace nodal::registration
