#include "stitch/view/camera.h"

#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/angles.h"
#include "scene.h"

namespace nodal::view {
namespace {

constexpr double kDegree = kPi / 180;

Camera made(CameraName name, double fov, geometry::YawPitchRoll pose = {}) {
  return Camera::make({name, pose, fov, 400, 300}).value();
}
Camera made(const char* name, double fov) { return made(parse_camera(name).value(), fov); }

/// Every projection, Pannini's with several d, and the widest field of view that the formula allows; less if `open`, because
/// there the picture is infinitely wide.
struct Example {
  const char* name;
  double widest;
  bool open = false;
};
constexpr Example kExamples[] = {
    {"perspective", 180, true}, {"fisheye", 360},       {"stereographic", 360, true}, {"equisolid", 360},
    {"orthographic", 180},      {"pannini", 360, true}, {"pannini:d=0", 180, true},   {"pannini:d=0.5", 240, true},
    {"pannini:d=2", 240, true}, {"cylindrical", 360},   {"cylinder_equal_area", 360}, {"mercator", 360},
    {"equirectangular", 360}};

/// Where a ray is shown, in focal lengths, as textbooks have it: by the plane, cylinder or sphere on which it is seen.
Eigen::Vector2d shown(const std::string& name, const geometry::Ray& ray) {
  const double x = ray.x(), y = ray.y(), z = ray.z();
  const double round = std::hypot(x, y), level = std::hypot(x, z);
  const Eigen::Vector2d outward = round > 0 ? Eigen::Vector2d(x / round, y / round) : Eigen::Vector2d::Zero();
  const double theta = std::atan2(x, z);
  if (name == "perspective") return {x / z, y / z};
  if (name == "fisheye") return std::atan2(round, z) * outward;
  if (name == "stereographic") return {2 * x / (1 + z), 2 * y / (1 + z)};
  if (name == "equisolid") return std::sqrt(2 * (1 - z)) * outward;  // the chord from the axis
  if (name == "orthographic") return {x, y};
  if (name == "cylindrical") return {theta, y / level};
  if (name == "cylinder_equal_area") return {theta, y};
  if (name == "mercator") return {theta, std::log((1 + y) / level)};  // ln(sec + tan)
  if (name == "equirectangular") return {theta, std::atan2(y, level)};
  // Pannini: the point of the cylinder of radius 1 about the vertical, seen from d behind its axis on the plane that touches it
  // in front.
  const double d = name == "pannini" ? 1 : std::stod(name.substr(name.find('=') + 1));
  const Eigen::Vector3d point = ray.direction() / level;
  return (1 + d) / (point.z() + d) * point.head<2>();
}

TEST(Camera, LeftAndRightEdge_AreTheFieldOfViewApart) {
  for (const Example& example : kExamples) {
    const Camera camera = made(example.name, 120);
    const auto left = camera.ray(0, 150).value(), right = camera.ray(400, 150).value();
    EXPECT_NEAR(geometry::angle_between(left, right), 120 * kDegree, 1e-12) << example.name;
    EXPECT_LT(left.x(), 0);
    EXPECT_NEAR(camera.ray(200, 150)->z(), 1, 1e-15);
    EXPECT_LT(camera.ray(200, 0)->y(), 0) << "up is -y";
  }
}

TEST(Camera, EveryPoint_IsWhereTheTextbooksShowItsRay) {
  for (const Example& example : kExamples) {
    for (const double fov : {1.0, 60.0, 120.0, example.widest - (example.open ? 1 : 0)}) {
      const Camera camera = made(example.name, fov);
      const double half = shown(example.name, geometry::Ray::at(geometry::Angles{fov / 2 * kDegree - 1e-15, 0})).x();
      int rays = 0;
      for (int y = 0; y <= 300; y += 10) {
        for (int x = 10; x < 400; x += 10) {
          const auto ray = camera.ray(x, y);
          if (!ray) continue;
          const Eigen::Vector2d at = shown(example.name, *ray) * (200 / half) + Eigen::Vector2d(200, 150);
          EXPECT_NEAR(at.x(), x, 1e-6) << example.name << " " << fov << " at " << x << " " << y;
          EXPECT_NEAR(at.y(), y, 1e-6) << example.name << " " << fov << " at " << x << " " << y;
          ++rays;
        }
      }
      EXPECT_GT(rays, 500) << example.name;
    }
  }
}

TEST(Camera, HalfWayToTheEdge_IsWhereEachFormulaSaysByHand) {
  const auto off_axis = [](const char* name, double fov) {
    return geometry::angle_between(made(name, fov).ray(300, 150).value(), geometry::Ray::towards(0, 0, 1));
  };
  EXPECT_NEAR(off_axis("perspective", 90), std::atan(0.5), 1e-12);
  EXPECT_NEAR(off_axis("fisheye", 180), kPi / 4, 1e-12);
  EXPECT_NEAR(off_axis("stereographic", 180), 2 * std::atan(0.5), 1e-12);
  EXPECT_NEAR(off_axis("equisolid", 180), 2 * std::asin(std::sqrt(0.5) / 2), 1e-12);
  EXPECT_NEAR(off_axis("orthographic", 180), kPi / 6, 1e-12);
  EXPECT_NEAR(off_axis("pannini", 180), 2 * std::atan(0.5), 1e-12) << "stereographic along the horizon";
  EXPECT_NEAR(off_axis("pannini:d=0", 90), std::atan(0.5), 1e-12) << "perspective";
  EXPECT_NEAR(off_axis("mercator", 180), kPi / 4, 1e-12);
}

TEST(Camera, UprightProjections_ShowVerticalsStraightAndTheAngleThatEachFormulaSaysByHand) {
  // Half a picture is pi wide: at pi / 2 below the horizon ...
  const auto below = [](const char* name) { return made(name, 360).ray(300, 150 + 100)->angles().phi; };
  EXPECT_NEAR(below("cylindrical"), std::atan(kPi / 2), 1e-12);
  EXPECT_NEAR(below("mercator"), 2 * std::atan(std::exp(kPi / 2)) - kPi / 2, 1e-12);
  EXPECT_NEAR(below("equirectangular"), kPi / 2, 1e-12);
  EXPECT_NEAR(made("cylinder_equal_area", 360).ray(300, 150 + 100 / kPi)->angles().phi, kPi / 6, 1e-12);
  // ... and in the middle, where the classic Pannini's scale is 1.
  EXPECT_NEAR(made("pannini", 180).ray(200, 250)->angles().phi, kPi / 4, 1e-12);
  for (const Example& example : kExamples) {
    if (parse_camera(example.name)->projection < Projection::kPannini) continue;
    const Camera camera = made(example.name, 120);
    EXPECT_NEAR(camera.ray(330, 150)->angles().theta, camera.ray(330, 190)->angles().theta, 1e-12) << example.name;
  }
}

TEST(Camera, FieldsOfView_EndWhereTheFormulaEnds) {
  for (const Example& example : kExamples) {
    const CameraName name = parse_camera(example.name).value();
    const double widest = example.widest - (example.open ? 1 : 0);
    EXPECT_EQ(name.widest_fov_deg(), widest) << example.name;
    EXPECT_TRUE(Camera::make({name, {}, widest, 400, 300})) << example.name;
    const auto wider = Camera::make({name, {}, widest + 0.5, 400, 300});
    ASSERT_FALSE(wider) << example.name;
    EXPECT_NE(wider.error().message.find(" camera shows 1 to " + std::to_string(name.widest_fov_deg())),
              std::string::npos)
        << wider.error().message;
  }
}

TEST(Camera, YawPitchRoll_AreRightUpClockwise) {
  EXPECT_NEAR(made({Projection::kPerspective}, 90, {90, 0, 0}).ray(200, 150)->x(), 1, 1e-12);
  EXPECT_NEAR(made({Projection::kPerspective}, 90, {0, 90, 0}).ray(200, 150)->y(), -1, 1e-12);
  // Rolled clockwise, the right edge of the view looks down.
  EXPECT_GT(made({Projection::kPerspective}, 90, {0, 0, 30}).ray(400, 150)->y(), 0.3);
}

TEST(Camera, BeyondTheProjection_ThereIsNothing) {
  const Camera fisheye = made("fisheye", 360);
  EXPECT_TRUE(fisheye.ray(399, 150));
  EXPECT_FALSE(fisheye.ray(399, 20)) << "the corner is 220 degrees off";
  EXPECT_FALSE(made("equisolid", 360).ray(1, 1));
  // A disc of radius 200 px.
  EXPECT_TRUE(made("orthographic", 180).ray(200 + 119, 150 + 159));
  EXPECT_FALSE(made("orthographic", 180).ray(200 + 121, 150 + 161));
  // The poles are pi / 2 and 1 from the horizon, of pi in 200 px.
  EXPECT_TRUE(made("equirectangular", 360).ray(7, 249.9));
  EXPECT_FALSE(made("equirectangular", 360).ray(7, 250.1));
  EXPECT_TRUE(made("cylinder_equal_area", 360).ray(7, 150 + 200 / kPi - 0.1));
  EXPECT_FALSE(made("cylinder_equal_area", 360).ray(7, 150 + 200 / kPi + 0.1));
}

TEST(Camera, TallPictures_HaveARayEverywhereThatTheFormulaReaches) {
  for (const char* name : {"mercator", "cylindrical", "pannini", "perspective", "stereographic"}) {
    const Camera camera = Camera::make({parse_camera(name).value(), {}, 170, 1, 16384}).value();
    const auto ray = camera.ray(0.5, 16384);
    ASSERT_TRUE(ray) << name;
    EXPECT_NEAR(ray->direction().norm(), 1, 1e-12) << name;
  }
}

TEST(Camera, ImpossibleFields_AreRefusedWithWhatIsPossible) {
  for (const double fov : {0.0, 180.0, -5.0, std::nan("")}) {
    const auto camera = Camera::make({{Projection::kPerspective}, {}, fov, 100, 100});
    ASSERT_FALSE(camera) << fov;
    EXPECT_NE(camera.error().message.find("the perspective camera shows 1 to 179"), std::string::npos);
  }
  const auto pannini = Camera::make({parse_camera("pannini:d=0.5").value(), {}, 300, 100, 100});
  EXPECT_NE(pannini.error().message.find("the pannini:d=0.5 camera shows 1 to 239"), std::string::npos);
}

TEST(Camera, Names_AreReadWithTheirParameter) {
  EXPECT_EQ(parse_camera("pannini")->d, 1);
  EXPECT_EQ(parse_camera("pannini:d=0.25")->d, 0.25);
  for (const std::string_view name : camera_names()) EXPECT_TRUE(parse_camera(name)) << name;
  EXPECT_NE(parse_camera("tiny").error().message.find("perspective, fisheye"), std::string::npos);
  EXPECT_NE(parse_camera("").error().message.find("perspective, fisheye"), std::string::npos);
  EXPECT_NE(parse_camera("fisheye:d=1").error().message.find("fisheye has no parameter"), std::string::npos);
  for (const char* text : {"pannini:", "pannini:d=", "pannini:d=-1", "pannini:d=101", "pannini:d=nan", "pannini:d=1x",
                           "pannini:0.5", "pannini:d=inf"}) {
    EXPECT_NE(parse_camera(text).error().message.find("a number from 0 to 100"), std::string::npos) << text;
  }
}

TEST(Camera, ViewIntoAnyRaymap_ShowsTheScene) {
  const parallel::Workers workers(2);
  for (const char* text : {"equirectangular", "cube", "octahedron", "compressed_spherical", "dual_paraboloid"}) {
    const geometry::LayoutName name = geometry::LayoutName::parse(text).value();
    const geometry::RaymapSize size = name.size_for_width(name.width_for_resolution(100));
    const auto layout = geometry::make_layout(name, size.width, size.height).value();
    const DecodedImage picture = picture_of(Target::of(*layout));
    const Resampler resampler(*layout, Filter::kBicubic, workers);
    for (const char* camera_name : {"perspective", "stereographic", "pannini", "mercator"}) {
      const Camera camera = Camera::make({parse_camera(camera_name).value(), {50, -65, 20}, 110, 120, 90}).value();
      const Target target{120, 90, [&](double x, double y) { return camera.ray(x, y); }, 0, true};
      const Off off = off_scene(resampler.resample(picture.view(), target, workers), target);
      EXPECT_LT(off.rms, 0.6) << text << " " << camera_name;
      EXPECT_LT(off.worst, 4) << text << " " << camera_name;
    }
  }
}

}  // namespace
}  // namespace nodal::view
