#include "stitch/geometry/head.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <Eigen/Geometry>
#include <cmath>

#include "examples.h"
#include "protocol/base/angles.h"
#include "stitch/geometry/raymap/fisheye_picture.h"

namespace nodal::geometry {
namespace {

Head head_of(const HeadCalibration& calibration) {
  Result<Head> head = Head::make(calibration);
  EXPECT_TRUE(head) << (head ? "" : head.error().text());
  return *head;
}

/// A ray at angle `a` from the head's axis, in the direction psi around the axis.
Ray ray_at(const Head& head, double a, double psi) {
  const Eigen::Vector3d d(std::sin(a) * std::cos(psi), std::sin(a) * std::sin(psi), std::cos(a));
  return head.R_head_rig().transpose() * Ray::towards(d);
}

TEST(Head, PinholeWithAspect_IsTheTextbooksMatrixProduct) {
  HeadCalibration calibration = head_with(RectilinearLens{{500}});
  const Head head = head_of(calibration);
  Eigen::Matrix3d K;
  K << 500, 0, 362.3, 0, 1.083 * 500, 233.9, 0, 0, 1;
  for (const Eigen::Vector3d& d :
       {Eigen::Vector3d(0.2, -0.3, 1), Eigen::Vector3d(-1, 0.4, 2), Eigen::Vector3d(0, 0, 1)}) {
    const Ray ray = Ray::towards(head.R_head_rig().transpose() * d);
    const Eigen::Vector3d p = K * head.R_head_rig() * ray.direction();
    const std::optional<Pixel> pixel = head.project(ray);
    ASSERT_TRUE(pixel);
    EXPECT_NEAR(pixel->x, p.x() / p.z(), 1e-9);
    EXPECT_NEAR(pixel->y, p.y() / p.z(), 1e-9);
  }
}

TEST(Head, RayBehindAPinhole_FallsNowhere) {
  const Head head = head_of(head_with(RectilinearLens{{500}}));
  EXPECT_FALSE(head.project(Ray::towards(-head.axis().direction())));
  EXPECT_FALSE(head.project(ray_at(head, kPi / 2, 0.3)));
}

TEST(Head, RayBehindAFisheye_FallsWhereItsAngleSays) {
  HeadCalibration calibration = head_with(EquidistantLens{{100}});
  calibration.R_head_rig = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const Head head = head_of(calibration);
  const std::optional<Pixel> pixel = head.project(Ray::towards(1, 0, -1));  // 135 degrees to the right
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x, 362.3 + 100 * 3 * kPi / 4, 1e-10);
  EXPECT_NEAR(pixel->y, 233.9, 1e-10);
}

/// A lens that sees so far shows this direction as a circle, of which no pixel is more right than another; its centre
/// shows the opposite direction.
TEST(Head, RayExactlyBehindAFisheye_FallsNowhere) {
  HeadCalibration calibration = head_with(EquidistantLens{{100}});
  calibration.R_head_rig = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const Head head = head_of(calibration);
  EXPECT_FALSE(head.project(Ray::towards(0, 0, -1)));
  EXPECT_FALSE(head.project_with_jacobian(Ray::towards(0, 0, -1)));
  ASSERT_TRUE(head.project(Ray::towards(1e-6, 0, -1)));
  EXPECT_NEAR(head.project(Ray::towards(1e-6, 0, -1))->x, 362.3 + 100 * kPi, 1e-3);
  EXPECT_EQ(head.project(Ray::towards(0, 0, 1))->x, 362.3);
}

TEST(FisheyePicture, RayExactlyBehindOneOf360Degrees_IsOnItsRim) {
  const auto layout = FisheyePicture{false, 360}.layout({200, 200});
  const std::optional<Pixel> behind = layout->pixel(Ray::towards(0, 0, -1));
  ASSERT_TRUE(behind);
  EXPECT_NEAR(std::hypot(behind->x - 100, behind->y - 100), 100, 1e-9);
  EXPECT_NEAR(layout->pixel(Ray::towards(0, 0, 1))->x, 100, 1e-9);
}

RC_GTEST_PROP(EveryHead, UnprojectOfProject_IsTheRay, ()) {
  for (const auto& [name, model] : every_kind_of_lens()) {
    const Head head = head_of(head_with(model));
    // Also close to the turning point, where the identity holds only to the square root of rounding.
    const bool near_end = *rc::gen::arbitrary<bool>();
    const double part = between(0, 1);
    const double a = head.lens().max_angle() * (near_end ? 1 - 1e-6 * part : part);
    const Ray ray = ray_at(head, a, between(-kPi, kPi));
    const std::optional<Pixel> pixel = head.project(ray);
    RC_ASSERT(pixel.has_value());
    const std::optional<Ray> back = head.unproject(*pixel);
    RC_ASSERT(back.has_value());
    const double tolerance = near_end || part > 0.999 ? 1e-5 : 1e-9;
    RC_ASSERT(angle_between(ray, *back) <= tolerance);
  }
}

RC_GTEST_PROP(EveryHead, ProjectOfUnproject_IsThePixel, ()) {
  for (const auto& [name, model] : every_kind_of_lens()) {
    const Head head = head_of(head_with(model));
    const Pixel pixel{between(0, 720), between(0, 480)};
    const std::optional<Ray> ray = head.unproject(pixel);
    if (!ray) continue;
    const std::optional<Pixel> back = head.project(*ray);
    RC_ASSERT(back.has_value());
    RC_ASSERT(std::hypot(back->x - pixel.x, back->y - pixel.y) <= 1e-8);
  }
}

RC_GTEST_PROP(EveryHead, PixelOf_IsWhatProjectGivesInTheRegionAndNothingElsewhere, ()) {
  for (const auto& [name, model] : every_kind_of_lens()) {
    HeadCalibration calibration = head_with(model);
    const double x = between(0, 700), y = between(0, 460);
    calibration.region = {x, y, between(x + 1, 720), between(y + 1, 480), {}};
    if (*rc::gen::arbitrary<bool>()) calibration.region.circle = Region::Circle{362.3, 233.9, between(20, 400)};
    const Result<Head> made = Head::make(calibration);
    if (!made) continue;  // the lens does not cover the region
    const Head& head = *made;
    for (int k = 0; k < 50; ++k) {
      // Half of the rays are at the region's border, where a ray that is left out too early would be.
      const auto corner = [&](double from, double to) { return *rc::gen::arbitrary<bool>() ? from : to; };
      const Region& region = calibration.region;
      const Pixel near{corner(region.left, region.right) + between(-1, 1),
                       corner(region.top, region.bottom) + between(-1, 1)};
      const std::optional<Ray> at = k % 2 == 0 ? head.unproject(near) : std::nullopt;
      const Ray ray = at ? *at : ray_at(head, between(0, kPi), between(-kPi, kPi));
      const std::optional<Pixel> pixel = head.project(ray), found = head.pixel_of(ray);
      const bool in = pixel && head.contains(*pixel);
      RC_ASSERT(found.has_value() == in);
      if (in) RC_ASSERT(found->x == pixel->x && found->y == pixel->y);
    }
  }
}

RC_GTEST_PROP(EveryHead, Jacobian_IsTheDifferenceQuotientOfProject, ()) {
  for (const auto& [name, model] : every_kind_of_lens()) {
    const Head head = head_of(head_with(model));
    const double end = std::min(head.lens().max_angle(), 1.4);
    const double a = *rc::gen::arbitrary<bool>() ? end * between(0, 0.98) : 1e-7 * between(0, 1);
    const Ray ray = ray_at(head, a, between(-kPi, kPi));
    const std::optional<Projection> projection = head.project_with_jacobian(ray);
    RC_ASSERT(projection.has_value());
    const Pixel projected = *head.project(ray);
    RC_ASSERT(std::hypot(projection->pixel.x - projected.x, projection->pixel.y - projected.y) <= 1e-9);
    for (int axis = 0; axis < 3; ++axis) {
      const double h = 1e-6;
      const Eigen::Vector3d w = h * Eigen::Vector3d::Unit(axis);
      const std::optional<Pixel> plus = head.project(rotation_about(w) * ray);
      const std::optional<Pixel> minus = head.project(rotation_about(-w) * ray);
      RC_ASSERT(plus.has_value() && minus.has_value());
      // A rotation by w moves the ray by w x ray.
      const Eigen::Vector2d by_jacobian = projection->J * Eigen::Vector3d::Unit(axis).cross(ray.direction());
      const Eigen::Vector2d by_difference((plus->x - minus->x) / (2 * h), (plus->y - minus->y) / (2 * h));
      RC_ASSERT((by_jacobian - by_difference).norm() <= 1e-4 * (1 + by_difference.norm()));
    }
  }
}

RC_GTEST_PROP(EveryHead, Density_IsPixelsPerSteradianAsDifferencesMeasureThem, ()) {
  for (const auto& [name, model] : every_kind_of_lens()) {
    const Head head = head_of(head_with(model));
    const double end = std::min(head.lens().max_angle(), 1.4);
    const Ray ray = ray_at(head, end * between(0, 0.97), between(-kPi, kPi));
    // A small square around the ray, along two tangents; the area of its picture is the density.
    const Eigen::Vector3d t1 = ray.direction().unitOrthogonal();
    const Eigen::Vector3d t2 = ray.direction().cross(t1);
    const double h = 1e-5;
    const auto at = [&](double s, double t) {
      return *head.project(Ray::towards(ray.direction() + s * h * t1 + t * h * t2));
    };
    const Pixel right = at(1, 0), left = at(-1, 0), down = at(0, 1), up = at(0, -1);
    const double area =
        std::abs((right.x - left.x) * (down.y - up.y) - (right.y - left.y) * (down.x - up.x)) / (4 * h * h);
    const double density = head.density(*head.project(ray));
    RC_ASSERT(std::abs(density - area) <= 1e-4 * area + 1e-3);
  }
}

TEST(Head, DensityOnTheAxis_IsItsLimit) {
  const Head head = head_of(head_with(EquidistantLens{{300}}));
  EXPECT_NEAR(head.density({362.3, 233.9}), 1.083 * 300 * 300, 1e-6);
  EXPECT_NEAR(head.density({362.3 + 1e-4, 233.9}), 1.083 * 300 * 300, 1e-3);
}

TEST(Head, DensityOfAPinhole_IsFocalSquaredOverCosineCubed) {
  // Gamma = cos^3 a / f^2 for an ideal pixel (§4.2).
  HeadCalibration calibration = head_with(RectilinearLens{{500}});
  calibration.aspect = 1;
  const Head head = head_of(calibration);
  const double a = 0.6;
  EXPECT_NEAR(head.density({362.3 + 500 * std::tan(a), 233.9}), 500 * 500 / std::pow(std::cos(a), 3), 1e-5);
}

TEST(Head, DensityBeyondTheLens_IsZero) {
  HeadCalibration calibration = head_with(EquidistantLens{{300}});
  calibration.max_angle = 0.5;
  EXPECT_EQ(head_of(calibration).density({362.3 + 151, 233.9}), 0);
}

TEST(HeadRegion, DistanceToEdge_IsToTheNearestOfRectangleCircleAndLens) {
  HeadCalibration calibration = head_with(EquidistantLens{{300}});
  calibration.aspect = 1;
  calibration.region = {10, 20, 700, 470, Region::Circle{362.3, 233.9, 240}};
  calibration.max_angle = 0.7;  // ends 210 px from the centre
  const Head head = head_of(calibration);
  EXPECT_NEAR(head.distance_to_edge({362.3, 233.9}), 210, 1e-9);
  EXPECT_NEAR(head.distance_to_edge({362.3, 25}), 1.1, 1e-9);   // the lens's limit, before the top edge
  EXPECT_NEAR(head.distance_to_edge({362.3, 5}), -18.9, 1e-9);  // outside the lens
  EXPECT_NEAR(head.distance_to_edge({362.3 + 205, 233.9}), 5, 1e-9);
  EXPECT_TRUE(head.contains({362.3 + 209.9, 233.9}));
  EXPECT_FALSE(head.contains({362.3 + 210.1, 233.9}));
  calibration.max_angle = 0;
  EXPECT_NEAR(head_of(calibration).distance_to_edge({362.3, 25}), 5, 1e-9);           // the top edge
  EXPECT_NEAR(head_of(calibration).distance_to_edge({362.3 + 235, 233.9}), 5, 1e-9);  // the circle
}

TEST(HeadRegion, WherePicturesAreStretched_TheLensEndsOnAnEllipse) {
  HeadCalibration calibration = head_with(EquidistantLens{{300}});
  calibration.aspect = 2;
  calibration.region = {0, 0, 720, 480, {}};
  calibration.max_angle = 0.3;  // 90 px across, 180 px down
  const Head head = head_of(calibration);
  EXPECT_NEAR(head.distance_to_edge({362.3 + 80, 233.9}), 10, 1e-9);
  EXPECT_NEAR(head.distance_to_edge({362.3, 233.9 + 160}), 20, 1e-9);
}

TEST(Head, Vignetting_FallsOffFromItsOwnCentreWithTheAspectTakenOut) {
  HeadCalibration calibration = head_with(figure3_lens());
  calibration.vignetting = {360, 240, 400, {-0.2, -0.08, 0.01}};
  const Head head = head_of(calibration);
  EXPECT_DOUBLE_EQ(head.vignetting({360, 240}), 1);
  EXPECT_DOUBLE_EQ(head.vignetting({760, 240}), 1 - 0.2 - 0.08 + 0.01);
  EXPECT_NEAR(head.vignetting({360, 240 + 1.083 * 200}), 1 - 0.2 / 4 - 0.08 / 16 + 0.01 / 64, 1e-15);
}

TEST(Head, Axis_IsWhereYawAndPitchPoint) {
  HeadCalibration calibration = head_with(figure3_lens());
  calibration.R_head_rig = rows_of(to_R_head_rig({90, 0, 17}));
  EXPECT_LE(angle_between(head_of(calibration).axis(), Ray::towards(1, 0, 0)), 1e-15);
}

TEST(Head, MatrixThatIsAReflection_IsRefusedByName) {
  HeadCalibration calibration = head_with(figure3_lens());
  calibration.R_head_rig = {1, 0, 0, 0, -1, 0, 0, 0, 1};
  const Result<Head> head = Head::make(calibration);
  ASSERT_FALSE(head);
  EXPECT_EQ(head.error().code, Errc::kNotARotation);
  EXPECT_NE(head.error().message.find("head 'head': R_head_rig is a reflection"), std::string::npos)
      << head.error().text();
}

TEST(Heads, OfARig_KeepTheDocumentsOrder) {
  Calibration calibration{"rig", "", {head_with(figure3_lens()), head_with(EquidistantLens{{300}})}};
  calibration.heads[1].name = "other";
  const Result<std::vector<Head>> heads = make_heads(calibration);
  ASSERT_TRUE(heads) << heads.error().text();
  ASSERT_EQ(heads->size(), 2u);
  EXPECT_EQ((*heads)[0].name(), "head");
  EXPECT_EQ((*heads)[1].name(), "other");
  calibration.heads[1].name = "head";
  EXPECT_FALSE(make_heads(calibration));
}

}  // namespace
}  // namespace nodal::geometry
