// Seams with planted faults: how far lines jump there follows from the fault, by geometry.
#include "stitch/offline/seam_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stitch/geometry/rotation.h"
#include "stitch/offline/best_blend.h"
#include "tests/support/rendered_rig.h"

namespace nodal::offline {
namespace {

constexpr bands::Grid kRaymap{1024, 512};
constexpr double kDegreesAPixel = 180.0 / kRaymap.height;

/// Six heads, one along each axis. Head 0 looks along z.
test::RenderedRig six_heads(double noise = 1) {
  return test::render_rig(test::six_fisheyes(280), hal::sim::town_square_scene(3), {PixelFormat::kGrey8, noise, 7, 2});
}

/// The rig as calibrated with its first head turned to the right.
Calibration with_first_turned(Calibration rig, double by_deg) {
  const Eigen::Matrix3d turn = geometry::to_R_head_rig({by_deg, 0, 0});
  const auto& R = rig.heads[0].R_head_rig;
  const Eigen::Matrix3d is = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R.data());
  rig.heads[0].R_head_rig = geometry::rows_of(is * turn);
  return rig;
}

std::vector<SeamCheck> checked(const Calibration& rig, const test::RenderedRig& rendered) {
  auto seams = check_seams(rig, rendered.frames(), kRaymap, 2);
  EXPECT_TRUE(seams) << seams.error().text();
  return *std::move(seams);
}

bool of_first(const SeamCheck& seam) { return seam.a == 0; }

TEST(SeamCheck, ARigAsItIs_IsGoodAtEachOfItsTwelveSeams) {
  const test::RenderedRig rig = six_heads();
  const std::vector<SeamCheck> seams = checked(rig.truth, rig);
  EXPECT_EQ(seams.size(), 12U) << "the edges of a cube";
  for (const SeamCheck& seam : seams) {
    EXPECT_EQ(verdict_of(seam), SeamVerdict::kGood) << seam.a << " and " << seam.b << ": " << usual_jump(seam);
    EXPECT_GE(seam.places.size(), 3U) << "the sky has little detail";
    EXPECT_LT(std::abs(seam.step_levels), 1.0);
  }
}

TEST(SeamCheck, AHeadTurnedByFourteenPixels_IsToBeLookedAtAtItsSeamsOnly) {
  const test::RenderedRig rig = six_heads();
  // Rays at the height of the eye are displaced by the whole angle, those 45 degrees above by cos 45 of it.
  for (const SeamCheck& seam : checked(with_first_turned(rig.truth, 14 * kDegreesAPixel), rig)) {
    if (!of_first(seam)) {
      EXPECT_EQ(verdict_of(seam), SeamVerdict::kGood) << seam.a << " and " << seam.b;
      continue;
    }
    EXPECT_EQ(verdict_of(seam), SeamVerdict::kLook) << seam.b;
    EXPECT_GT(usual_jump(seam), 14 * 0.7 - 2);
    EXPECT_LT(usual_jump(seam), 14 + 1.5);
  }
}

TEST(SeamCheck, AHeadTurnedByFourPixels_IsUsable) {
  const test::RenderedRig rig = six_heads();
  const std::vector<SeamCheck> seams = checked(with_first_turned(rig.truth, 4 * kDegreesAPixel), rig);
  EXPECT_EQ(verdict_of(seams), SeamVerdict::kUsable);
  EXPECT_EQ(std::ranges::count_if(seams, [](const SeamCheck& s) { return verdict_of(s) == SeamVerdict::kUsable; }),
            std::ranges::count_if(seams, of_first));
}

TEST(SeamCheck, TheSameFaultOnASmallerSphere_IsSmaller) {
  const test::RenderedRig rig = six_heads();
  const Calibration turned = with_first_turned(rig.truth, 4 * kDegreesAPixel);
  const auto seams = check_seams(turned, rig.frames(), {256, 128}, 2).value();
  EXPECT_EQ(verdict_of(seams), SeamVerdict::kGood) << "it is one pixel of this one";
}

TEST(SeamCheck, AHeadTurnedByFarMoreThanIsTried_ShowsDifferentThings) {
  const test::RenderedRig rig = six_heads();
  for (const SeamCheck& seam : checked(with_first_turned(rig.truth, 120 * kDegreesAPixel), rig)) {
    if (!of_first(seam)) continue;
    EXPECT_EQ(verdict_of(seam), SeamVerdict::kLook) << seam.b;
    EXPECT_FALSE(worst_place(seam)->alike);
  }
}

TEST(SeamCheck, AHeadCalibratedTwiceAsBright_IsAStepAndNoJump) {
  const test::RenderedRig rig = six_heads();
  Calibration bright = rig.truth;
  bright.heads[0].gain.fill(2);
  for (const SeamCheck& seam : checked(bright, rig)) {
    if (!of_first(seam)) continue;
    EXPECT_EQ(verdict_of(seam), SeamVerdict::kLook);
    EXPECT_GT(std::abs(seam.step_levels), kBrokenStep);
    EXPECT_LE(usual_jump(seam), kFinePx);
  }
}

TEST(SeamCheck, AMissingHead_HasNoSeams) {
  const test::RenderedRig rig = six_heads();
  std::vector<ImageView> frames = rig.frames();
  frames[0].planes[0].data = nullptr;
  const auto seams = check_seams(rig.truth, frames, kRaymap, 2).value();
  EXPECT_FALSE(seams.empty());
  EXPECT_TRUE(std::ranges::none_of(seams, of_first));
}

TEST(SeamCheck, ASkyWithoutDetail_IsGoodAndSaysThatNothingWasSeen) {
  test::RenderedRig rig = six_heads();
  for (auto& picture : rig.bytes) std::ranges::fill(picture, std::uint8_t{128});
  for (const SeamCheck& seam : checked(with_first_turned(rig.truth, 3), rig)) {
    EXPECT_EQ(verdict_of(seam), SeamVerdict::kGood);
    EXPECT_GT(seam.looked_at, 0U);
    EXPECT_TRUE(seam.places.empty());
    EXPECT_EQ(worst_place(seam), nullptr);
  }
}

TEST(SeamCheck, OneThreadOrThree_SayTheSame) {
  const test::RenderedRig rig = six_heads();
  const Calibration turned = with_first_turned(rig.truth, 3 * kDegreesAPixel);
  const auto one = check_seams(turned, rig.frames(), kRaymap, 1).value();
  const auto three = check_seams(turned, rig.frames(), kRaymap, 3).value();
  ASSERT_EQ(one.size(), three.size());
  for (std::size_t k = 0; k < one.size(); ++k) {
    EXPECT_EQ(usual_jump(one[k]), usual_jump(three[k]));
    EXPECT_EQ(one[k].step_levels, three[k].step_levels);
  }
}

TEST(SeamCheck, BestBlend_ChecksItsOwnSeams) {
  const test::RenderedRig rig = six_heads();
  const auto verdict = [&](double turned_px) {
    const Calibration turned = with_first_turned(rig.truth, turned_px * kDegreesAPixel);
    auto blend = BestBlend::make(turned, {"equirectangular", kRaymap.width, kRaymap.height, PixelFormat::kGrey8}, 2);
    std::vector<SeamCheck> checks;
    EXPECT_TRUE(blend->blend(rig.frames(), &checks));
    EXPECT_FALSE(checks.empty());
    return verdict_of(checks);
  };
  EXPECT_EQ(verdict(0), SeamVerdict::kGood);
  EXPECT_EQ(verdict(14), SeamVerdict::kUsable) << "its flow bends lines by so much";
  EXPECT_EQ(verdict(60), SeamVerdict::kLook) << "more than its flow moves";
}

TEST(SeamVerdict, OneLeafThatMovedInThirtyPlaces_IsGood) {
  SeamCheck seam{0, 1, 30, std::vector<SeamPlace>(30), 0};
  seam.places[4] = {{}, 40, false};
  EXPECT_EQ(verdict_of(seam), SeamVerdict::kGood);
  EXPECT_EQ(worst_place(seam), &seam.places[4]);
  for (std::size_t k = 0; k < 6; ++k) seam.places[k] = {{}, 40, false};
  EXPECT_EQ(verdict_of(seam), SeamVerdict::kLook);
}

}  // namespace
}  // namespace nodal::offline
