// Rigs whose heads have positions, in rooms: the raymap against what the rig's nodal point sees.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stitch/offline/offline_blend.h"
#include "tests/support/rendered_rig.h"

namespace nodal::offline {
namespace {

constexpr int kDistanceWidth = 256;

/// dB between a blended raymap and the scene itself, evaluated along each pixel's ray.
double psnr(const test::RenderedRig& rig, const Calibration& calibration, const hal::sim::ScenePtr& scene) {
  const table::RaymapSpec spec{"equirectangular", kDistanceWidth, kDistanceWidth / 2, PixelFormat::kGrey8};
  const auto blend = OfflineBlend::make(calibration, spec, {}, rig.format, 2, {});
  EXPECT_TRUE(blend) << blend.error().text();
  const auto raymap = blend->blend(rig.frames());
  EXPECT_TRUE(raymap) << raymap.error().text();
  const auto layout = geometry::make_layout(spec.layout, spec.width, spec.height).value();
  double square = 0;
  for (int y = 0; y < spec.height; ++y) {
    for (int x = 0; x < spec.width; ++x) {
      const Eigen::Vector3d d = layout->ray(x + 0.5, y + 0.5)->direction();
      const hal::sim::Light light = scene->light({d.x(), d.y(), d.z()}, 0.02);
      const double grey = 255 * std::clamp(0.299 * light.r + 0.587 * light.g + 0.114 * light.b, 0.0, 1.0);
      square += std::pow(raymap->bytes[static_cast<std::size_t>(y * kDistanceWidth + x)] - grey, 2);
    }
  }
  return 10 * std::log10(255 * 255 / (square / (spec.height * kDistanceWidth)));
}

Calibration at(Calibration rig, double distance) {
  rig.distance = distance;
  return rig;
}

TEST(Distance, InABallOfThatRadius_TheRaymapIsAsGoodAsARigAtOnePoint) {
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  const test::Room ball{test::Room::Shape::kBall, 2};
  const Calibration one_point = test::six_fisheyes(160);
  const double best = psnr(test::render_rig_in(ball, one_point, town), one_point, town);
  const Calibration spread = test::spread_out(one_point, 0.3);
  const test::RenderedRig rig = test::render_rig_in(ball, spread, town);
  EXPECT_GT(psnr(rig, at(spread, 2), town), best - 0.6);
  EXPECT_LT(psnr(rig, spread, town), best - 4) << "at infinity everything doubles";
}

TEST(Distance, InABox_TheDistanceOfItsWallsIsMuchBetterThanInfinity) {
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  const Calibration spread = test::spread_out(test::six_fisheyes(160), 0.3);
  const test::RenderedRig rig = test::render_rig_in({test::Room::Shape::kBox, 2}, spread, town);
  // Seams lie where two or three axes are equally far, at 2 sqrt 2 to 2 sqrt 3 m.
  const double infinity = psnr(rig, spread, town), walls = psnr(rig, at(spread, 2.8), town);
  EXPECT_GT(walls, infinity + 2);
  EXPECT_LT(psnr(rig, at(spread, 0.6), town), walls - 2);
}

TEST(Distance, OfAMillionMetres_IsInfinity) {
  const Calibration spread = test::spread_out(test::six_fisheyes(160), 0.1);
  const test::RenderedRig rig = test::render_rig(spread, hal::sim::town_square_scene(3));
  const table::RaymapSpec spec{"equirectangular", kDistanceWidth, kDistanceWidth / 2, PixelFormat::kGrey8};
  const auto raymap = [&](const Calibration& calibration) {
    return OfflineBlend::make(calibration, spec, {}, rig.format, 2, {})->blend(rig.frames()).value().bytes;
  };
  const std::vector<std::uint8_t> infinity = raymap(spread), far = raymap(at(spread, 1e6));
  for (std::size_t k = 0; k < far.size(); ++k) ASSERT_LE(std::abs(int{far[k]} - int{infinity[k]}), 1) << k;
}

}  // namespace
}  // namespace nodal::offline
