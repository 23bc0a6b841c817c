#include "stitch/calibration/lens/lens_model.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stitch/geometry/head.h"

namespace nodal::calibration {
namespace {

LensParameters tsai() {
  LensParameters lens{LensKind::kTsai, parameter_count(LensKind::kTsai), {}};
  lens.values = {360.8, 224.6, 1.083, 490.0, 2.29e-6, 1.65e-11};
  return lens;
}
LensParameters kannala_brandt() {
  LensParameters lens{LensKind::kKannalaBrandt, parameter_count(LensKind::kKannalaBrandt), {}};
  lens.values = {350.1, 250.2, 0.98, 250.0, -5.0, 0.7, -0.2, 0.01};
  return lens;
}
LensParameters equidistant() {
  LensParameters lens{LensKind::kEquidistant, parameter_count(LensKind::kEquidistant), {}};
  lens.values = {355.0, 240.0, 1.0, 260.0, 3.0, -12.0, 1.0};
  return lens;
}

class EveryLens : public testing::TestWithParam<LensParameters> {};

TEST_P(EveryLens, Ray_IsWhatTheHeadOfTheDocumentSees) {
  HeadCalibration head;
  head.name = "head";
  head.width = 720;
  head.height = 480;
  head.center_x = GetParam()[kCenterX];
  head.center_y = GetParam()[kCenterY];
  head.aspect = GetParam()[kAspect];
  head.lens = GetParam().model();
  head.region = {0, 0, 720, 480, {}};
  const auto made = geometry::Head::make(head);
  ASSERT_TRUE(made) << made.error().text();
  const SightFinder finder(GetParam());
  for (const geometry::Pixel p : {geometry::Pixel{10, 20}, {360.8, 224.6}, {700, 300}, {500.5, 470.25}}) {
    const auto sight = finder.at(p);
    ASSERT_TRUE(sight);
    EXPECT_LT((sight->ray - made->unproject(p)->direction()).norm(), 1e-10);
  }
}

TEST_P(EveryLens, Derivatives_AreWhatDifferencesSay) {
  const geometry::Pixel p{611.3, 77.9};
  const auto sight = SightFinder(GetParam()).at(p);
  ASSERT_TRUE(sight);
  for (int k = 0; k < GetParam().count; ++k) {
    const double step = 1e-6 * std::max(std::abs(GetParam()[k]), 1e-8);
    LensParameters more = GetParam(), less = GetParam();
    more[k] += step;
    less[k] -= step;
    const Eigen::Vector3d difference = (SightFinder(more).at(p)->ray - SightFinder(less).at(p)->ray) / (2 * step);
    EXPECT_LT((difference - sight->by_parameter.col(k)).norm(), 1e-5 * difference.norm() + 1e-9) << "parameter " << k;
  }
  const SightFinder finder(GetParam());
  const Eigen::Vector3d by_x = (finder.at({p.x + 1e-4, p.y})->ray - finder.at({p.x - 1e-4, p.y})->ray) / 2e-4;
  const Eigen::Vector3d by_y = (finder.at({p.x, p.y + 1e-4})->ray - finder.at({p.x, p.y - 1e-4})->ray) / 2e-4;
  EXPECT_LT((by_x - sight->by_pixel.col(0)).norm(), 1e-8);
  EXPECT_LT((by_y - sight->by_pixel.col(1)).norm(), 1e-8);
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryLens, testing::Values(tsai(), kannala_brandt(), equidistant()));

TEST(PlaneFinder, PointOfThePlane_IsFoundAgainAlongItsRay) {
  const Pose pose = Pose{}.moved({0.3, -0.2, 1.1}, {0.05, -0.02, -0.4});
  const Eigen::Vector2d at(0.21, -0.13);
  const Eigen::Vector3d in_head = pose.R * Eigen::Vector3d(at.x(), at.y(), 0) + pose.t;
  const auto point = PlaneFinder(pose).at(in_head.normalized());
  ASSERT_TRUE(point);
  EXPECT_LT((point->at - at).norm(), 1e-12);
  EXPECT_LT((point->in_head - in_head).norm(), 1e-12);
  EXPECT_NEAR(point->distance, in_head.norm(), 1e-12);
}

TEST(PlaneFinder, RayBehindTheHeadOrAlongThePlane_MeetsNothing) {
  const PlaneFinder plane{Pose{}};
  EXPECT_FALSE(plane.at({0, 0, -1}));
  EXPECT_FALSE(plane.at(Eigen::Vector3d(1, 0, 0.01).normalized()));
  EXPECT_TRUE(plane.at({0, 0, 1}));
}

TEST(PlaneFinder, Derivatives_AreWhatDifferencesSay) {
  const Pose pose = Pose{}.moved({0.3, -0.2, 0.4}, {0.05, -0.02, -0.4});
  const Eigen::Vector3d ray = Eigen::Vector3d(0.2, -0.1, 1).normalized();
  const auto point = PlaneFinder(pose).at(ray);
  ASSERT_TRUE(point);
  constexpr double kStep = 1e-6;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d e = kStep * Eigen::Vector3d::Unit(k);
    // Moving the pattern by e moves the ray's intersection in the opposite direction.
    const Eigen::Vector2d by_move = (PlaneFinder(pose.moved(Eigen::Vector3d::Zero(), e)).at(ray)->at -
                                     PlaneFinder(pose.moved(Eigen::Vector3d::Zero(), -e)).at(ray)->at) /
                                    (2 * kStep);
    EXPECT_LT((by_move + point->by_move.col(k)).norm(), 1e-7);
    const Eigen::Vector2d by_turn = (PlaneFinder(pose.moved(e, Eigen::Vector3d::Zero())).at(ray)->at -
                                     PlaneFinder(pose.moved(-e, Eigen::Vector3d::Zero())).at(ray)->at) /
                                    (2 * kStep);
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(k);
    const Eigen::Vector3d swept(unit.y() * point->in_head.z() - unit.z() * point->in_head.y(),
                                unit.z() * point->in_head.x() - unit.x() * point->in_head.z(),
                                unit.x() * point->in_head.y() - unit.y() * point->in_head.x());
    EXPECT_LT((by_turn + point->by_move * swept).norm(), 1e-7);
  }
}

TEST(LensKindNamed, UnknownName_IsRefusedWithThoseThereAre) {
  EXPECT_EQ(*lens_kind_named("tsai"), LensKind::kTsai);
  const auto refused = lens_kind_named("pinhole");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("kannala_brandt"), std::string::npos);
}

}  // namespace
}  // namespace nodal::calibration
