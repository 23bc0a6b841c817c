// Whole lenses are estimated only where overlaps show enough of them.
#include "stitch/registration/seen_radii.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"
#include "stitch/geometry/lens/lens.h"
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
  Calibration rig = fisheye_pair(400, 220, 0);
  const double edge = 110 * kRadiansPerDegree, focal = 0.48 * 400 / (2 * std::tan(edge / 2));
  const auto of = [focal](double factor) { return focal * factor; };
  for (HeadCalibration& head : rig.heads) {
    head.lens = EquidistantLens{{of(1), 0, of(1.0 / 12), 0, of(1.0 / 120), 0, of(17.0 / 20160), 0, of(31.0 / 362880)}};
  }
  const auto seen = seen_radii(rig);
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

// With whole lenses, heads agree, and the lens is tens of percent off at 10 degrees.
TEST(Register, LensesOfADataSheetThatShareTheirRims_AreNotBentAndThatIsSaid) {
  const test::RenderedRig rig = test::render_rig(fisheye_pair(320, 205, -0.025), hal::sim::town_square_scene(3),
                                                 {PixelFormat::kGrey8, 1.0, 5, 2});
  Options options;
  options.free = Free::kLens;
  options.lens_far_off = true;
  const auto report = register_heads(fisheye_pair(320, 205, 0), {rig.frames()}, options);
  ASSERT_TRUE(report) << report.error().text();
  for (std::size_t h = 0; h < 2; ++h) {
    const double is = geometry::Lens::make(rig.truth.heads[h].lens)->radius(10 * kRadiansPerDegree).value_or(0);
    const double says =
        geometry::Lens::make(report->calibration.heads[h].lens)->radius(10 * kRadiansPerDegree).value_or(0);
    EXPECT_LT(std::abs(says / is - 1), 0.12);  // 8 % by the other family, and what its rim is off
  }
  EXPECT_TRUE(std::ranges::any_of(report->warnings, [](const std::string& warning) {
    return warning.find("because heads show the same things only") != std::string::npos;
  }));
}

}  // namespace
}  // namespace nodal::registration
