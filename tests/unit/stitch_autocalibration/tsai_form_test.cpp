// Kannala-Brandt lenses as Tsai's.
#include "stitch/autocalibration/tsai_form.h"

#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/angles.h"
#include "stitch/geometry/lens/lens.h"
#include "tests/support/rigs.h"

namespace nodal::autocalibration {
namespace {

Calibration rig_of(const KannalaBrandtLens& lens) {
  Calibration rig;
  rig.name = "pair";
  for (int h = 0; h < 2; ++h) {
    rig.heads.push_back(test::plain_head("cam" + std::to_string(h), 720, 480, 90.0 * h, 60));
    rig.heads.back().lens = lens;
    rig.heads.back().max_angle = 0;
  }
  return rig;
}

TEST(TsaiForm, NearlyRectilinearLens_IsTheSameWithinHalfAPixel) {
  const KannalaBrandtLens lens{495, {-0.3111, 0.1459, -0.0002, 0}};  // the lens of ten rendered heads
  const auto tsai = with_tsai_lenses(rig_of(lens));
  ASSERT_TRUE(tsai);
  const auto from = geometry::Lens::make(lens).value(), to = geometry::Lens::make(tsai->heads[1].lens).value();
  EXPECT_TRUE(std::holds_alternative<TsaiLens>(tsai->heads[0].lens));
  for (double deg = 5; deg <= 50; deg += 5) {
    const double angle = deg * kRadiansPerDegree;
    EXPECT_NEAR(to.radius(angle).value_or(0), from.radius(angle).value_or(-1), 0.5) << deg;
  }
}

TEST(TsaiForm, FisheyesAndOtherModels_HaveNone) {
  EXPECT_FALSE(with_tsai_lenses(rig_of({230, {0, 0, 0, 0}}))) << "sees 107 degrees from its axis";
  Calibration rig = rig_of({495, {-0.3111, 0.1459, -0.0002, 0}});
  rig.heads[1].lens = RectilinearLens{{500}};
  EXPECT_FALSE(with_tsai_lenses(rig));
}

// 2 % off in the middle of the picture, and right near its edge: Tsai's two coefficients do not bend so.
TEST(TsaiForm, LensThatItDoesNotFit_HasNone) {
  const KannalaBrandtLens lens{400, {0.9, -1.6, 0.85, 0}};
  const auto made = geometry::Lens::make(lens);
  ASSERT_TRUE(made) << made.error().text();
  ASSERT_LT(made->angle(std::hypot(360, 240)).value_or(9), 60 * kRadiansPerDegree);
  EXPECT_FALSE(with_tsai_lenses(rig_of(lens)));
}

}  // namespace
}  // namespace nodal::autocalibration
