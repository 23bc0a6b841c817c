// Heads with positions, in a rig with a distance.
#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <Eigen/Geometry>
#include <numbers>

#include "examples.h"
#include "stitch/geometry/head.h"

namespace nodal::geometry {
namespace {

struct Pair {
  Head here;         ///< at its position, in a rig with the distance
  Head at_infinity;  ///< the same head
  Eigen::Vector3d position;
  double distance = 0;
};

Pair any_pair(LensModel lens) {
  HeadCalibration calibration = head_with(lens);
  calibration.position = {between(-0.5, 0.5), between(-0.5, 0.5), between(-0.5, 0.5)};
  const double distance = between(1.1, 50);
  return {Head::make(calibration, distance).value(),
          Head::make(calibration).value(),
          {calibration.position[0], calibration.position[1], calibration.position[2]},
          distance};
}

Ray any_ray(const Head& head, double most) {
  const double a = between(0, most), psi = between(0, 2 * std::numbers::pi);
  return head.R_head_rig().transpose() *
         Ray::towards({std::sin(a) * std::cos(psi), std::sin(a) * std::sin(psi), std::cos(a)});
}

RC_GTEST_PROP(HeadAtADistance, ProjectsWhatLiesThereAsThePointIsSeenFromItsPosition, ()) {
  const Pair pair = any_pair(EquidistantLens{{320}});
  const Ray ray = any_ray(pair.here, 2.5);
  const Eigen::Vector3d point = pair.distance * ray.direction();
  const std::optional<Pixel> pixel = pair.here.project(ray);
  const std::optional<Pixel> seen = pair.at_infinity.project(Ray::towards(point - pair.position));
  RC_ASSERT(pixel.has_value() && seen.has_value());
  RC_ASSERT(std::hypot(pixel->x - seen->x, pixel->y - seen->y) < 1e-7);
}

RC_GTEST_PROP(HeadAtADistance, UnprojectIsTheReverse, ()) {
  const Pair pair = any_pair(EquidistantLens{{320}});
  const Ray ray = any_ray(pair.here, 2);
  const std::optional<Ray> back = pair.here.unproject(pair.here.project(ray).value());
  RC_ASSERT(back.has_value());
  RC_ASSERT((back->direction() - ray.direction()).norm() < 1e-9);
}

RC_GTEST_PROP(HeadAtADistance, JacobianIsThatOfFiniteDifferences, ()) {
  const Pair pair = any_pair(figure3_lens());
  const Ray ray = any_ray(pair.here, 0.4);
  const std::optional<Projection> made = pair.here.project_with_jacobian(ray);
  RC_PRE(made.has_value());
  const Eigen::Vector3d across = ray.direction().unitOrthogonal();
  for (const Eigen::Vector3d& way : {across, Eigen::Vector3d(ray.direction().cross(across))}) {
    constexpr double kStep = 1e-6;
    const Pixel ahead = pair.here.project(Ray::towards(ray.direction() + kStep * way)).value();
    const Pixel behind = pair.here.project(Ray::towards(ray.direction() - kStep * way)).value();
    const Eigen::Vector2d slope((ahead.x - behind.x) / (2 * kStep), (ahead.y - behind.y) / (2 * kStep));
    RC_ASSERT((made->J * way - slope).norm() < 1e-4 * (1 + slope.norm()));
  }
}

TEST(HeadAtADistance, TheDocumentsExample_Is286DegreesToTheLeft) {
  HeadCalibration calibration = head_with(EquidistantLens{{100}});
  calibration.R_head_rig = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  calibration.position = {0.1, 0, 0};
  const Head head = Head::make(calibration, 2).value();
  EXPECT_NEAR(head.project(Ray())->x - calibration.center_x, -100 * 2.8624 * std::numbers::pi / 180, 1e-3);
}

}  // namespace
}  // namespace nodal::geometry
