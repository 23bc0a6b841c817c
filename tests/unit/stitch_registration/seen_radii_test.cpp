// Whole lenses are estimated only where overlaps show enough of them.
#include "stitch/registration/seen_radii.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "protocol/base/angles.h"
#include "stitch/geometry/lens/lens.h"
#include "stitch/registration/check_frames.h"
#include "stitch/registration/known_lens.h"
#include "stitch/registration/registration.h"
#include "tests/support/rendered_rig.h"
#include "tests/support/rigs.h"

namespace nodal::registration {
namespace {

/// Two fisheyes back to back; `bend`: of the lens, per cube of the angle.
Calibration fisheye_pair(int side, double view_deg, double bend) {
  Calibration rig;
  rig.name = "pair";
  const double edge = view_deg / 2 * kRadiansPerDegree, radius = 0.48 * side;
  const double focal = radius / (edge + bend * std::pow(edge, 3));
  for (int h = 0; h < 2; ++h) {
    HeadCalibration head = test::plain_head("cam" + std::to_string(h), side, side, 180.0 * h);
    head.lens = EquidistantLens{{focal, 0, focal * bend}};
    head.max_angle = edge;
    head.region = {0, 0, double(side), double(side), Region::Circle{side / 2.0, side / 2.0, radius}};
    rig.heads.push_back(head);
  }
  return rig;
}

/// The same of 220 degrees with r = 2 f tan(a / 2), as a series.
Calibration stereographic_pair(int side) {
  Calibration rig = fisheye_pair(side, 220, 0);
  const double focal = 0.48 * side / (2 * std::tan(110 * kRadiansPerDegree / 2));
  const auto of = [focal](double factor) { return focal * factor; };
  for (HeadCalibration& head : rig.heads) {
    head.lens = EquidistantLens{{of(1), 0, of(1.0 / 12), 0, of(1.0 / 120), 0, of(17.0 / 20160), 0, of(31.0 / 362880)}};
  }
  return rig;
}

TEST(SeenRadii, FisheyesBackToBack_ShowTheirRims) {
  const auto seen = seen_radii(fisheye_pair(400, 220, 0));
  ASSERT_TRUE(seen) << seen.error().text();
  EXPECT_NEAR(seen->span, 40.0 / 110, 0.05);
  EXPECT_NEAR(seen->from_deg, 70, 5);
  EXPECT_NEAR(seen->to_deg, 110, 5);
  EXPECT_FALSE(seen->determine_lenses());
}

// 70 to 110 degrees: half of the radius, because 2 tan(a / 2) grows towards the rim. Whole lenses came out 124 % wrong.
TEST(SeenRadii, StereographicLensesBackToBack_ShowNoMoreOfTheirLensesThanOthers) {
  const auto seen = seen_radii(stereographic_pair(400));
  ASSERT_TRUE(seen) << seen.error().text();
  EXPECT_NEAR(seen->span, 40.0 / 110, 0.05);
  EXPECT_FALSE(seen->determine_lenses());
}

TEST(SeenRadii, RingsThatShareAQuarter_ShowEnough) {
  Calibration ring = test::ring(6, 640, 480);
  for (HeadCalibration& head : ring.heads) head.lens = RectilinearLens{{320 / std::tan(40 * kRadiansPerDegree)}};
  const auto seen = seen_radii(ring);  // 80 degrees every 60: all that is more than 20 of 40 degrees to one side
  ASSERT_TRUE(seen) << seen.error().text();
  EXPECT_TRUE(seen->determine_lenses()) << seen->span;
  EXPECT_NEAR(seen->span, 1 - 320 * std::tan(20 * kRadiansPerDegree) / std::tan(40 * kRadiansPerDegree) / 400, 0.05);
}

TEST(SeenRadii, HeadsThatDoNotOverlap_ShowNothing) {
  const auto seen = seen_radii(test::ring(2, 640, 480));
  ASSERT_TRUE(seen) << seen.error().text();
  EXPECT_EQ(seen->span, 0);
}

class KnownLensOfAPair : public testing::Test {
 protected:
  static KnownLens known(const Options& asked, Free estimated) {
    const Calibration rig = fisheye_pair(400, 220, 0);
    return known_lens(rig, SeenRadii{40.0 / 110, 70, 110}, asked, estimated).value();
  }
};

// Lenses that have the same radius at 90 degrees fit rims that are seen from 70 to 110 degrees: r = 2a/pi, tan(a/2) and
// sqrt(2) sin(a/2). They differ by 2 % where the first two do, and at the axis by 4/pi and by pi/4.
TEST_F(KnownLensOfAPair, OfAnAssumedKind_IsKnownWhereKindsAgree) {
  Options asked;
  asked.free = Free::kLens;
  asked.lens_far_off = asked.lens_kind_assumed = true;
  const KnownLens lens = known(asked, Free::kFocals);
  EXPECT_NEAR(lens.from_deg, 87, 0.5);
  EXPECT_NEAR(lens.to_deg, 93, 0.5);
  EXPECT_NEAR(lens.unsure, 4 / std::numbers::pi - 1 + 0.02, 0.002);
  EXPECT_NEAR(lens.from_px, 192 * lens.from_deg / 110, 0.1);
  EXPECT_NEAR(lens.to_px, 192 * lens.to_deg / 110, 0.1);
  const std::string text = commented("From the data sheet.", lens);
  EXPECT_TRUE(text.starts_with("From the data sheet. The lenses are known 87 to 93 degrees")) << text;
  EXPECT_NE(text.find("30 %"), std::string::npos) << text;
  EXPECT_EQ(commented(text, lens), text) << "once, however often the rig is registered";
}

// 110 degrees are at the edge of the circle: r(a) / r(110) of 2 sin(a/2), 2 tan(a/2) and a.
TEST_F(KnownLensOfAPair, WhoseFieldOfViewIsGiven_IsKnownAtItsEdge) {
  Options asked;
  asked.lens_far_off = asked.lens_kind_assumed = true;
  const KnownLens lens = known(asked, Free::kRotations);
  EXPECT_NEAR(lens.to_deg, 110, 0.5);
  EXPECT_NEAR(lens.from_deg, 107.5, 1);
  const double edge = 110 * kRadiansPerDegree;
  EXPECT_NEAR(lens.unsure, 2 * std::tan(edge / 2) / edge - 1 + 0.02, 0.002);
}

TEST_F(KnownLensOfAPair, OfAGivenKind_IsKnownWhereItIsSeen) {
  Options asked;
  asked.free = Free::kLens;
  asked.lens_far_off = true;
  const KnownLens sheet = known(asked, Free::kFocals);
  EXPECT_EQ(sheet.from_deg, 70);
  EXPECT_EQ(sheet.to_deg, 110);
  EXPECT_GT(sheet.unsure, 0);
  asked.lens_far_off = false;
  const KnownLens calibrated = known(asked, Free::kFocals);
  EXPECT_EQ(calibrated.unsure, 0);
  EXPECT_NE(where_known(calibrated).find("as they were before"), std::string::npos);
}

// With whole lenses, heads agree, and the lens is tens of percent off at 10 degrees.
TEST(Register, LensesOfADataSheetThatShareTheirRims_AreNotBentAndThatIsSaid) {
  const test::RenderedRig rig = test::render_rig(fisheye_pair(320, 205, -0.025), hal::sim::town_square_scene(3),
                                                 {PixelFormat::kGrey8, 1.0, 5, 2});
  Options options;
  options.free = Free::kLens;
  options.lens_far_off = options.lens_kind_assumed = true;
  const auto report = register_heads(fisheye_pair(320, 205, 0), {rig.frames()}, options);
  ASSERT_TRUE(report) << report.error().text();
  for (std::size_t h = 0; h < 2; ++h) {
    const double is = geometry::Lens::make(rig.truth.heads[h].lens)->radius(10 * kRadiansPerDegree).value_or(0);
    const double says =
        geometry::Lens::make(report->calibration.heads[h].lens)->radius(10 * kRadiansPerDegree).value_or(0);
    EXPECT_LT(std::abs(says / is - 1), 0.12);  // 8 % by the other family, and what its rim is off
  }
  EXPECT_TRUE(std::ranges::any_of(report->warnings, [](const std::string& warning) {
    return warning.find("because heads show the same things only") != std::string::npos &&
           warning.find("The lenses are known") != std::string::npos;
  }));
  ASSERT_TRUE(report->lens);
  const double known = (report->lens->from_deg + report->lens->to_deg) / 2 * kRadiansPerDegree;
  EXPECT_NEAR(geometry::Lens::make(report->calibration.heads[0].lens)->radius(known).value_or(0) /
                  geometry::Lens::make(rig.truth.heads[0].lens)->radius(known).value_or(1),
              1, 0.02);
  EXPECT_NE(report->calibration.comment.find("The lenses are known"), std::string::npos);
}

// r_a = 2 f tan(a / 2), and r_b of the opposite lens is 2 f / tan(a / 2): a focal length may grow as the other one
// shrinks. Heads 12 mm before the middle of a room of 4 m made one 4 % too long and the other one 3 % too short, and
// the report said that they are sure to 0.5 %.
TEST(Register, FocalLengthsOfStereographicLensesBackToBack_DoNotDriftApart) {
  Calibration truth = stereographic_pair(320);
  truth.heads[0].position = {0, 0, 0.012};
  truth.heads[1].position = {0, 0, -0.012};
  for (HeadCalibration& head : truth.heads) head.region.circle->radius -= 0.5;  // what is beyond it is black
  const test::RenderedRig rig = test::render_rig_in({test::Room::Shape::kBox, 4}, truth,
                                                    hal::sim::town_square_scene(11), {PixelFormat::kGrey8, 1.0, 11, 2});
  Calibration prior = truth;
  for (HeadCalibration& head : prior.heads) head.position = {};
  for (const Free free : {Free::kFocals, Free::kLens}) {
    Options options;
    options.free = free;
    options.lens_far_off = free == Free::kLens;
    const auto report = register_heads(prior, {rig.frames()}, options);
    ASSERT_TRUE(report) << report.error().text();
    for (const HeadReport& head : report->heads) EXPECT_LT(std::abs(head.focal_change_percent), 1) << head.name;
    EXPECT_TRUE(report->lens);
  }
}

}  // namespace
}  // namespace nodal::registration
