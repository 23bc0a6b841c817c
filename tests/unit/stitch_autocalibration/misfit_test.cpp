// Pictures that would fit if they were mirrored or had another focal length: five heads that look to the right, one
// after the other.
#include "stitch/autocalibration/misfit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <variant>

#include "stitch/autocalibration/autocalibration.h"
#include "stitch/geometry/rotation.h"
#include "tests/support/rendered_rig.h"

namespace nodal::autocalibration {
namespace {

constexpr int kSide = 400;

struct Set {
  std::vector<DecodedImage> pictures;
  std::vector<std::string> names;
};

Set render(double zoom_of_third) {
  Calibration rig = test::six_fisheyes(kSide, 90);
  rig.heads.resize(5);
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    rig.heads[h].R_head_rig = geometry::rows_of(geometry::to_R_head_rig({30.0 * static_cast<double>(h), 0, 0}));
    rig.heads[h].region = Region{0, 0, kSide, kSide, {}};
  }
  std::get<EquidistantLens>(rig.heads[2].lens).coefficients[0] *= zoom_of_third;
  const test::RenderedRig rendered = test::render_rig(rig, hal::sim::town_square_scene(3), {.noise_levels = 1});
  Set set;
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    set.pictures.push_back({PixelFormat::kGrey8, kSide, kSide, rendered.bytes[h]});
    set.names.push_back(rig.heads[h].name);
  }
  return set;
}

void mirror(DecodedImage& picture) {
  for (auto row = picture.bytes.begin(); row != picture.bytes.end(); row += kSide) std::reverse(row, row + kSide);
}

TEST(Misfit, MirroredPicture_IsNamedAndTheOthersArePlaced) {
  Set set = render(1);
  mirror(set.pictures[2]);
  const auto found = autocalibrate(set.pictures, set.names, {});
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_EQ(found->placed, (std::vector<std::size_t>{0, 1, 3, 4}));
  ASSERT_EQ(found->misfits.size(), 1U);
  EXPECT_EQ(found->misfits[0].cause, Misfit::Cause::kMirrored);
  EXPECT_EQ(found->misfits[0].picture, 2U);
}

TEST(Misfit, PictureOfTwiceTheFocalLength_IsNamedWithTheRatio) {
  const Set set = render(2);
  const auto found = autocalibrate(set.pictures, set.names, {});
  ASSERT_TRUE(found) << found.error().text();
  ASSERT_EQ(found->misfits.size(), 1U);
  EXPECT_EQ(found->misfits[0].cause, Misfit::Cause::kFocal);
  EXPECT_EQ(found->misfits[0].picture, 2U);
  EXPECT_NEAR(found->misfits[0].focal_ratio, 2, 0.15);
}

TEST(Misfit, TwoPicturesOnly_AreRefusedWithTheCause) {
  for (const bool mirrored : {true, false}) {
    Set set = render(mirrored ? 1 : 2);
    set.pictures = {set.pictures[1], set.pictures[2]};
    set.names = {"a", "b"};
    if (mirrored) mirror(set.pictures[1]);
    const auto found = autocalibrate(set.pictures, set.names, {});
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().code, Errc::kHeadMismatch);
    const char* const says = mirrored ? "a and b fit together only if one of them is mirrored"
                                      : "a and b show the same things at different scales: the focal length of b";
    EXPECT_NE(found.error().message.find(says), std::string::npos) << found.error().message;
  }
}

TEST(Misfit, APictureOfSomethingElse_IsNoMisfit) {
  Set set = render(1);
  const test::RenderedRig other =
      test::render_rig(test::six_fisheyes(kSide, 90), hal::sim::town_square_scene(3), {.noise_levels = 1});
  set.pictures[2].bytes = other.bytes[3];  // to the left, where no other head looks
  const auto found = autocalibrate(set.pictures, set.names, {});
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_EQ(found->placed.size(), 4U);
  EXPECT_TRUE(found->misfits.empty());
  const auto two = autocalibrate({set.pictures[1], set.pictures[2]}, {"a", "b"}, {});
  ASSERT_FALSE(two);
  EXPECT_EQ(two.error().code, Errc::kNoCoverage);
}

}  // namespace
}  // namespace nodal::autocalibration
