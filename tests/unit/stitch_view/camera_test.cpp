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

/// Every projection, Pannini's with several d and the fisheye's with several coefficients, and the widest field of view
/// that the formula allows; less if `open`, because there the picture is infinitely wide.
struct Example {
  const char* name;
  double widest;
  bool open = false;
};
constexpr Example kExamples[] = {{"perspective", 180, true},
                                 {"fisheye", 360},
                                 {"stereographic", 360, true},
                                 {"equisolid", 360},
                                 {"orthographic", 180},
                                 {"pannini", 360, true},
                                 {"pannini:d=0", 180, true},
                                 {"pannini:d=0.5", 240, true},
                                 {"pannini:d=2", 240, true},
                                 {"cylindrical", 360},
                                 {"cylinder_equal_area", 360},
                                 {"mercator", 360},
                                 {"equirectangular", 360},
                                 {"fisheye:f1=320", 360},
                                 {"fisheye:f1=2,f2=0.5,f9=1e-4", 360},
                                 {"fisheye:f3=-0.05,f5=0.003", 360},
                                 // 1 - 0.3 a^2 is 0 at 104.6 degrees.
                                 {"fisheye:f3=-0.1", 209}};

/// The number behind `key` in a camera's text, or `otherwise`.
double given(const std::string& name, const std::string& key, double otherwise) {
  const std::size_t at = name.find(key + "=");
  return at == std::string::npos ? otherwise : std::stod(name.substr(at + key.size() + 1));
}

/// f1 a + f2 a^2 + ... with a fisheye's coefficients.
double fisheye_r(const std::string& name, double a) {
  double r = given(name, "f1", 1) * a;
  for (int k = 2; k <= 9; ++k) r += given(name, "f" + std::to_string(k), 0) * std::pow(a, k);
  return r;
}

/// Where a ray is shown, in focal lengths, as textbooks have it: by the plane, cylinder or sphere on which it is seen.
Eigen::Vector2d shown(const std::string& name, const geometry::Ray& ray) {
  const double x = ray.x(), y = ray.y(), z = ray.z();
  const double round = std::hypot(x, y), level = std::hypot(x, z);
  const Eigen::Vector2d outward = round > 0 ? Eigen::Vector2d(x / round, y / round) : Eigen::Vector2d::Zero();
  const double theta = std::atan2(x, z);
  if (name == "perspective") return {x / z, y / z};
  if (name.starts_with("fisheye")) return fisheye_r(name, std::atan2(round, z)) * outward;
  if (name == "stereographic") return {2 * x / (1 + z), 2 * y / (1 + z)};
  if (name == "equisolid") return std::sqrt(2 * (1 - z)) * outward;  // the chord from the axis
  if (name == "orthographic") return {x, y};
  if (name == "cylindrical") return {theta, y / level};
  if (name == "cylinder_equal_area") return {theta, y};
  if (name == "mercator") return {theta, std::log((1 + y) / level)};  // ln(sec + tan)
  if (name == "equirectangular") return {theta, std::atan2(y, level)};
  // Pannini: the point of the cylinder of radius 1 about the vertical, seen from d behind its axis on the plane that
  // touches it in front.
  const double d = given(name, "d", 1);
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

TEST(Camera, FisheyesWithCoefficients_HaveTheAngleOfEveryRadius) {
  constexpr int kWide = 4000;
  // The last turns at 90 degrees. With the one before it r is nearly a^2: it hardly rises in the middle.
  for (const std::string name : {"fisheye:f1=2,f2=0.5,f9=1e-4", "fisheye:f1=300,f2=-12,f3=20,f4=-5,f5=0.5",
                                 "fisheye:f1=1e-6,f2=1e6", "fisheye:f3=-0.13509491152311703"}) {
    const CameraName read = parse_camera(name).value();
    for (const double fov : {1.0, 90.0, 0.0 + read.widest_fov_deg()}) {
      const Camera camera = Camera::make({read, {}, fov, kWide, kWide}).value();
      const double focal = kWide / 2 / fisheye_r(name, fov / 2 * kDegree);
      for (int k = 0; k < kWide / 2; ++k) {
        const double px = k + 0.5, slant = 0.3 * k;
        const geometry::Ray ray =
            camera.ray(kWide / 2 + px * std::cos(slant), kWide / 2 + px * std::sin(slant)).value();
        const double a = std::atan2(std::hypot(ray.x(), ray.y()), ray.z());
        EXPECT_NEAR(focal * fisheye_r(name, a), px, 1e-9) << name << " " << fov;
        EXPECT_NEAR(std::atan2(ray.y(), ray.x()), std::remainder(slant, 2 * kPi), 1e-9) << name << " " << fov;
      }
    }
  }
}

TEST(Camera, FisheyesWithOneCoefficient_AreThePlainFisheye) {
  const Camera plain = made("fisheye", 200);
  for (const char* name : {"fisheye:f1=1", "fisheye:f1=7.3", "fisheye:f1=0.000001", "fisheye:f1=1,f2=0,f9=0"}) {
    const Camera camera = made(name, 200);
    for (int x = 0; x < 400; x += 7) {
      const auto expected = plain.ray(x + 0.5, 77.5), ray = camera.ray(x + 0.5, 77.5);
      ASSERT_TRUE(ray) << name;
      EXPECT_EQ(ray->direction(), expected->direction()) << name;
    }
  }
}

TEST(Camera, FisheyesWithTheSameRatios_AreTheSame) {
  const Camera one = made("fisheye:f1=1,f2=0.25,f3=-0.0625", 170), other = made("fisheye:f1=400,f2=100,f3=-25", 170);
  for (int x = 0; x < 400; x += 7) {
    EXPECT_LT((one.ray(x, 77)->direction() - other.ray(x, 77)->direction()).norm(), 1e-14);
  }
}

TEST(Camera, FisheyeOfOpenCv_ShowsPointsWhereOpenCvDoes) {
  // cv2.fisheye.projectPoints (4.6.0) with K = diag(300, 300, 1), D = (0.08, -0.02, 0.005, -0.001), of rays at these
  // angles.
  struct Point {
    double angle_deg, px;
  };
  constexpr Point kPoints[] = {{0, 0},
                               {10, 52.486511048017661},
                               {30, 160.30394469591832},
                               {45, 245.69612098051005},
                               {60, 335.78155254933813},
                               {75, 429.96296711970768},
                               {85, 493.58522135641516}};
  const CameraName name = parse_camera("fisheye:f3=0.08,f5=-0.02,f7=0.005,f9=-0.001").value();
  // The picture whose focal length is 300 px: it ends at the last point.
  const Point last = kPoints[std::size(kPoints) - 1];
  const Camera camera = Camera::make({name, {}, 2 * last.angle_deg, 1000, 1000}).value();
  for (const auto& [angle_deg, px] : kPoints) {
    const auto ray = camera.ray(500 + px / last.px * 500, 500);
    EXPECT_NEAR(std::atan2(ray->x(), ray->z()), angle_deg * kDegree, 1e-12) << angle_deg;
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
  // 1 - 0.3 a^2 is 0 at a = 1.826, where r = 1.217: the disc ends, though a fisheye may see 180 degrees off its axis.
  const Camera turning = made("fisheye:f3=-0.1", 180);
  const double end = 200 * 1.2171612389 / (kPi / 2 - 0.1 * std::pow(kPi / 2, 3));
  EXPECT_TRUE(turning.ray(200 + 0.8 * (end - 0.01), 150 + 0.6 * (end - 0.01)));
  EXPECT_FALSE(turning.ray(200 + 0.8 * (end + 0.01), 150 + 0.6 * (end + 0.01)));
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

TEST(Camera, FisheyesThatTurnBack_AreRefusedWithHowFarTheyWork) {
  const auto refused = [](const char* name, double fov) {
    return Camera::make({parse_camera(name).value(), {}, fov, 100, 100}).error().message;
  };
  EXPECT_EQ(refused("fisheye:f1=1,f3=-0.1", 210),
            "a field of view of 210 degrees; the fisheye:f3=-0.1 camera shows 1 to 209");
  EXPECT_EQ(refused("fisheye:f9=-1,f1=2", 200),
            "a field of view of 200 degrees; the fisheye:f1=2,f9=-1 camera shows 1 to 94");  // 2 (2 / 9)^(1 / 8)
  // At the turning point itself the field of view is still shown: 1 - 3 * 0.1350949... (pi / 2)^2 is 0.
  EXPECT_EQ(parse_camera("fisheye:f3=-0.13509491152311703")->widest_fov_deg(), 180);
  EXPECT_EQ(parse_camera("fisheye:f2=-300").error().message,
            "camera 'fisheye:f2=-300': f1 a + f2 a^2 + ... rises only up to a field of view of 0.190986 degrees; the "
            "least is 1");
  EXPECT_EQ(parse_camera("fisheye:f2=-57")->widest_fov_deg(), 1);  // 1 / 57 radian
}

TEST(Camera, Names_AreReadWithTheirParameter) {
  EXPECT_EQ(parse_camera("pannini")->d, 1);
  EXPECT_EQ(parse_camera("pannini:d=0.25")->d, 0.25);
  for (const std::string_view name : camera_names()) EXPECT_TRUE(parse_camera(name)) << name;
  EXPECT_NE(parse_camera("tiny").error().message.find("perspective, fisheye"), std::string::npos);
  EXPECT_NE(parse_camera("").error().message.find("perspective, fisheye"), std::string::npos);
  EXPECT_NE(parse_camera("mercator:d=1").error().message.find("mercator has no parameter"), std::string::npos);
  EXPECT_EQ(parse_camera("fisheye")->f, (std::array<double, 9>{1}));
  EXPECT_EQ(parse_camera("fisheye:f4=-0.5,f2=1e-3")->f, (std::array<double, 9>{1, 1e-3, 0, -0.5}));
  EXPECT_EQ(parse_camera("fisheye:f1=1000000,f2=1000000")->f[1], 1e6);
  EXPECT_EQ(parse_camera("fisheye:f1=0.000001")->f[0], 1e-6);
  for (const char* text :
       {"fisheye:",           "fisheye:f1",          "fisheye:f1=",     "fisheye:f1=0",      "fisheye:f1=-1",
        "fisheye:f1=nan",     "fisheye:f2=nan",      "fisheye:f2=inf",  "fisheye:f2=-inf",   "fisheye:f2=1e400",
        "fisheye:f2=1000001", "fisheye:f2=-1000001", "fisheye:f1=1e-7", "fisheye:f0=1",      "fisheye:f10=1",
        "fisheye:f2=1x",      "fisheye:f2=1,",       "fisheye:,f2=1",   "fisheye:f2=1,f2=1", "fisheye:f2=1;f3=1",
        "fisheye:f2=1, f3=1", "fisheye:d=1",         "fisheye:1"}) {
    const auto read = parse_camera(text);
    ASSERT_FALSE(read) << text;
    EXPECT_NE(read.error().message.find("f1=F1,f2=F2 and so on up to f9, each once"), std::string::npos) << text;
  }
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
    for (const char* camera_name :
         {"perspective", "stereographic", "pannini", "mercator", "fisheye:f2=0.7,f3=-0.1", "fisheye:f1=0.01,f2=1"}) {
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
