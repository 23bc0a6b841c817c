// Seams with planted faults: how far lines jump there follows from the fault, by geometry.
#include "stitch/offline/seam_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include "stitch/geometry/head.h"
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

/// Fills each picture with patterns that no other picture shows: leaves have no direction, boards have one.
void fill_differently(test::RenderedRig& rig, bool boards) {
  std::mt19937_64 random(9);
  for (auto& picture : rig.bytes) {
    const int side = rig.truth.heads[0].width;
    std::vector<int> noise(picture.size());
    for (int& level : noise) level = static_cast<int>(random() % 256);
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        int sum = 0;  // blobs of 3 px, or boards of 4 px along the diagonal, dark and bright in turn
        for (int j = 0; j < 3; ++j) {
          for (int i = 0; i < 3; ++i) sum += noise[static_cast<std::size_t>((y + j) % side * side + (x + i) % side)];
        }
        const int number = (x + y) / 4, height = 30 + noise[static_cast<std::size_t>(number)] * 80 / 255;
        const int board = number % 2 == 0 ? 125 - height : 125 + height;
        picture[static_cast<std::size_t>(y * side + x)] = static_cast<std::uint8_t>(boards ? board : sum / 9);
      }
    }
  }
}

TEST(SeamCheck, LeavesThatAreElsewhere_AreNoBrokenLines) {
  test::RenderedRig rig = six_heads();
  fill_differently(rig, false);
  for (const SeamCheck& seam : checked(rig.truth, rig)) {
    EXPECT_NE(verdict_of(seam), SeamVerdict::kLook) << seam.a << " and " << seam.b;
  }
}

TEST(SeamCheck, LinesThatEndAtTheSeam_AreToBeLookedAt) {
  test::RenderedRig rig = six_heads();
  fill_differently(rig, true);
  const std::vector<SeamCheck> seams = checked(rig.truth, rig);
  EXPECT_EQ(seams.size(), 12U);
  for (const SeamCheck& seam : seams) {
    EXPECT_EQ(verdict_of(seam), SeamVerdict::kLook) << seam.a << " and " << seam.b;
  }
}

TEST(SeamCheck, LinesThatDifferBesideTheSeamOnly_GoOn) {
  // Head 0 looks along z, head 1 shows what is right of it: the seam is where x equals z.
  test::RenderedRig rig = six_heads();
  fill_differently(rig, true);
  const auto heads = geometry::make_heads(rig.truth).value();
  const int side = rig.truth.heads[0].width;
  constexpr double kBeside = 0.04;  // rad on each side of the seam in which all heads show the same
  for (std::size_t h = 0; h < heads.size(); ++h) {
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const auto ray = heads[h].unproject({x + 0.5, y + 0.5});
        if (!ray) continue;
        std::array<double, 3> along{std::abs(ray->x()), std::abs(ray->y()), std::abs(ray->z())};
        std::ranges::sort(along);
        const double off = (along[2] - along[1]) / std::sqrt(2.0);
        if (off > kBeside) continue;
        // Lines that cross the seam.
        const double level = 125 + 60 * std::sin(2 * std::numbers::pi * 12 * along[0]);
        rig.bytes[h][static_cast<std::size_t>(y * side + x)] = static_cast<std::uint8_t>(std::lround(level));
      }
    }
  }
  Calibration plain = rig.truth;  // what was painted has no fall-off
  for (HeadCalibration& head : plain.heads) {
    head.gain.fill(1);
    head.vignetting = {};
  }
  for (const SeamCheck& seam : checked(plain, rig)) {
    EXPECT_NE(verdict_of(seam), SeamVerdict::kLook) << seam.a << " and " << seam.b;
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

TEST(SeamMap, OfAPartOfTheSphere_IsFiner) {
  const test::RenderedRig rig = six_heads();
  const auto columns = [&](int seen_columns) {
    const bands::Window seen{4096, 2048, seen_columns, 64};
    return BestBlend::make(rig.truth, {"equirectangular", 8192, 4096, PixelFormat::kGrey8}, 2, seen)->map().width;
  };
  EXPECT_EQ(columns(4100), BestBlend::kMapWidth);
  EXPECT_EQ(columns(4096), 2 * BestBlend::kMapWidth);
  EXPECT_EQ(columns(2048), 4 * BestBlend::kMapWidth);
  EXPECT_EQ(columns(100), 4 * BestBlend::kMapWidth);
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
