#include "stitch/table/tabled_lens.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "stitch/table/head_sight.h"

namespace nodal::table {
namespace {

const LensModel kLenses[] = {
    TsaiLens{490, 2.29e-6, 1.65e-11},  // Figure 3
    TsaiLens{490, -1e-6, 0},           // turns back at 577 px
    RectilinearLens{{300, 0, -20}},    // turns back
    EquidistantLens{{200, 0, 5}},      // beyond 180 degrees
    KannalaBrandtLens{250, {0.02, -0.01, 0, 0}},
};

TEST(TabledLens, EveryModelOverItsWholeDomain_IsTheLensItself) {
  for (const LensModel& model : kLenses) {
    const Result<geometry::Lens> lens = geometry::Lens::make(model);
    ASSERT_TRUE(lens) << lens.error().text();
    for (const double reach : {lens->max_angle(), 0.6 * lens->max_angle()}) {
      const TabledLens tabled(*lens, reach);
      for (int k = 0; k <= 5000; ++k) {
        const double angle = reach * k / 5000;
        const std::optional<TabledLens::Radius> radius = tabled.radius(std::sin(angle), std::cos(angle));
        const double expected = lens->radius(angle).value();
        ASSERT_TRUE(radius);
        EXPECT_NEAR(radius->radius, expected, 4 * TabledLens::kTolerance)
            << "model " << model.index() << " at " << angle;
        const double slope = lens->slope(angle, expected);
        // At the very end of a lens that turns back the slope is unbounded, and rounding determines its sign.
        if (slope > 0 && slope < 1e6) {
          EXPECT_NEAR(radius->slope, slope, 1e-6 * slope + 1e-3) << "model " << model.index() << " at " << angle;
        }
        const std::optional<double> back = tabled.angle(expected * (1 - 1e-15));
        ASSERT_TRUE(back);
        EXPECT_NEAR(*back, lens->angle(expected * (1 - 1e-15)).value(), 1e-8) << "model " << model.index();
      }
      if (const double beyond = reach * 1.001; beyond < std::numbers::pi) {
        EXPECT_FALSE(tabled.radius(std::sin(beyond), std::cos(beyond)));
      }
    }
  }
}

TEST(TabledLens, ExactlyBehindAFisheye_AHeadSeesNothing) {
  HeadCalibration calibration;
  calibration.name = "head";
  calibration.width = calibration.height = 200;
  calibration.center_x = calibration.center_y = 100;
  calibration.region = {0, 0, 200, 200, {}};
  calibration.lens = EquidistantLens{{100}};  // sees every direction, the last one as a circle
  calibration.R_head_rig = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const geometry::Head head = geometry::Head::make(calibration).value();
  const TabledLens tabled(head.lens(), 3.2);
  EXPECT_TRUE(see(head, tabled, {0, 0, 1}, 0.1));
  EXPECT_FALSE(see(head, tabled, {0, 0, -1}, 0.1));
  EXPECT_FALSE(see(head, tabled, {1e-12, 0, -1}, 0.1));
}

}  // namespace
}  // namespace nodal::table
