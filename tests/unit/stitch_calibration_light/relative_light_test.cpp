// How much brighter each head is than the others, of rendered heads whose pictures were made brighter by known factors.
#include <gtest/gtest.h>

#include <cmath>

#include "hal/sim/scene/scene.h"
#include "stitch/calibration/light/relative_light.h"
#include "tests/support/rendered_rig.h"
#include "tests/support/rigs.h"

namespace nodal::calibration {
namespace {

TEST(RelativeLight, HeadsWithKnownFactors_AreFoundToAFiftiethOfAStop) {
  const std::array kStops{0.5, -0.5, 0.2, -0.2, 0.0, 0.0};  // their mean is zero
  const Calibration truth = test::six_fisheyes(160);
  test::RenderedRig rig = test::render_rig(truth, hal::sim::town_square_scene(3), {PixelFormat::kRgb24, 1.0, 5, 3});
  for (std::size_t h = 0; h < kStops.size(); ++h) {
    for (std::uint8_t& level : rig.bytes[h]) {
      level = static_cast<std::uint8_t>(std::lround(level * 0.5 * std::exp2(kStops[h])));
    }
  }
  // A thing that one head alone sees: a quarter of its picture is bright.
  for (std::size_t k = 0; k < rig.bytes[4].size() / 4; ++k) rig.bytes[4][k] = 200;
  const auto heads = geometry::make_heads(truth);
  ASSERT_TRUE(heads);
  const RelativeLight found = relative_light(truth, *heads, {"", rig.frames(), {}});
  for (std::size_t h = 0; h < kStops.size(); ++h) {
    EXPECT_NEAR(found.stops[h], kStops[h], 0.02) << h;
    EXPECT_LT(found.sigma[h], 0.02) << h;
  }
}

TEST(RelativeLight, HeadsThatShareNothing_AreNotKnown) {
  Calibration truth = test::six_fisheyes(160);
  const test::RenderedRig rig = test::render_rig(truth, hal::sim::town_square_scene(3), {PixelFormat::kRgb24, 1, 5, 2});
  std::vector<ImageView> frames = rig.frames();
  truth.heads.resize(1);
  frames.resize(1);
  const auto heads = geometry::make_heads(truth);
  ASSERT_TRUE(heads);
  const RelativeLight found = relative_light(truth, *heads, {"", frames, {}});
  EXPECT_EQ(found.stops.at(0), 0);
  EXPECT_GT(found.sigma.at(0), kUnknownLight);
}

}  // namespace
}  // namespace nodal::calibration
