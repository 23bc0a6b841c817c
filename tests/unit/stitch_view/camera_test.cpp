#include "stitch/view/camera.h"

#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/angles.h"
#include "scene.h"

namespace nodal::view {
namespace {

Camera made(Projection projection, double fov, geometry::YawPitchRoll pose = {}) {
  return Camera::make({projection, pose, fov, 400, 300}).value();
}

TEST(Camera, LeftAndRightEdge_AreTheFieldOfViewApart) {
  for (const Projection projection :
       {Projection::kPerspective, Projection::kFisheye, Projection::kStereographic, Projection::kEquisolid}) {
    const Camera camera = made(projection, 120);
    const auto left = camera.ray(0, 150).value(), right = camera.ray(400, 150).value();
    EXPECT_NEAR(geometry::angle_between(left, right), 120 * kPi / 180, 1e-12);
    EXPECT_LT(left.x(), 0);
    EXPECT_NEAR(camera.ray(200, 150)->z(), 1, 1e-15);
    EXPECT_LT(camera.ray(200, 0)->y(), 0) << "up is -y";
  }
}

TEST(Camera, HalfWayToTheEdge_IsWhereEachFormulaSaysByHand) {
  const auto off_axis = [](Projection projection, double fov) {
    return geometry::angle_between(made(projection, fov).ray(300, 150).value(), geometry::Ray::towards(0, 0, 1));
  };
  EXPECT_NEAR(off_axis(Projection::kPerspective, 90), std::atan(0.5), 1e-12);
  EXPECT_NEAR(off_axis(Projection::kFisheye, 180), kPi / 4, 1e-12);
  EXPECT_NEAR(off_axis(Projection::kStereographic, 180), 2 * std::atan(0.5), 1e-12);
  EXPECT_NEAR(off_axis(Projection::kEquisolid, 180), 2 * std::asin(std::sqrt(0.5) / 2), 1e-12);
}

TEST(Camera, YawPitchRoll_AreRightUpClockwise) {
  EXPECT_NEAR(made(Projection::kPerspective, 90, {90, 0, 0}).ray(200, 150)->x(), 1, 1e-12);
  EXPECT_NEAR(made(Projection::kPerspective, 90, {0, 90, 0}).ray(200, 150)->y(), -1, 1e-12);
  // Rolled clockwise, the right edge of the view looks down.
  EXPECT_GT(made(Projection::kPerspective, 90, {0, 0, 30}).ray(400, 150)->y(), 0.3);
}

TEST(Camera, BeyondTheProjection_ThereIsNothing) {
  const Camera fisheye = made(Projection::kFisheye, 360);
  EXPECT_TRUE(fisheye.ray(399, 150));
  EXPECT_FALSE(fisheye.ray(399, 20)) << "the corner is 220 degrees off";
  EXPECT_FALSE(made(Projection::kEquisolid, 360).ray(1, 1));
}

TEST(Camera, ImpossibleFields_AreRefusedWithWhatIsPossible) {
  for (const double fov : {0.0, 180.0, -5.0, std::nan("")}) {
    const auto camera = Camera::make({Projection::kPerspective, {}, fov, 100, 100});
    ASSERT_FALSE(camera) << fov;
    EXPECT_NE(camera.error().message.find("a perspective camera shows 1 to 179"), std::string::npos);
  }
  EXPECT_NE(parse_projection("tiny").error().message.find("perspective, fisheye"), std::string::npos);
}

TEST(Camera, ViewIntoAnyRaymap_ShowsTheScene) {
  const parallel::Workers workers(2);
  for (const char* text : {"equirectangular", "cube", "octahedron", "compressed_spherical", "dual_paraboloid"}) {
    const geometry::LayoutName name = geometry::LayoutName::parse(text).value();
    const geometry::RaymapSize size = name.size_for_width(name.width_for_resolution(100));
    const auto layout = geometry::make_layout(name, size.width, size.height).value();
    const DecodedImage picture = picture_of(Target::of(*layout));
    const Resampler resampler(*layout, Filter::kBicubic, workers);
    for (const Projection projection : {Projection::kPerspective, Projection::kStereographic}) {
      const Camera camera = Camera::make({projection, {50, -65, 20}, 110, 120, 90}).value();
      const Target target{120, 90, [&](double x, double y) { return camera.ray(x, y); }, 0, true};
      const Off off = off_scene(resampler.resample(picture.view(), target, workers), target);
      EXPECT_LT(off.rms, 0.6) << text;
      EXPECT_LT(off.worst, 4) << text;
    }
  }
}

}  // namespace
}  // namespace nodal::view
