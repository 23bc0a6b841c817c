#include "stitch/calibration/lens/start.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "stitch/geometry/rotation.h"

namespace nodal::calibration {
namespace {

constexpr double kF = 490, kK1 = 2.29e-6, kK2 = 1.65e-11;
const Eigen::Vector2d kCenter(360, 240);

/// The pixel of the pattern's point X: the paper's lens, inverted by bisection.
Eigen::Vector2d project(const Pose& pose, const Eigen::Vector2d& X) {
  const Eigen::Vector3d p = pose.R * Eigen::Vector3d(X.x(), X.y(), 0) + pose.t;
  const double ideal = kF * std::hypot(p.x(), p.y()) / p.z();
  double low = 0, high = 2000;
  for (int n = 0; n < 60; ++n) {
    const double r = (low + high) / 2;
    (r * (1 + kK1 * r * r + kK2 * r * r * r * r) < ideal ? low : high) = r;
  }
  return kCenter + low * Eigen::Vector2d(p.x(), p.y()).normalized();
}

std::vector<PointPair> pairs_of(const Pose& pose, int right, int wrong, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> any(-0.5, 0.5);
  std::normal_distribution<double> noise(0, 0.3);
  std::vector<PointPair> pairs;
  for (int n = 0; n < right + wrong; ++n) {
    const Eigen::Vector2d X(any(engine), 0.7 * any(engine));
    Eigen::Vector2d u = project(pose, X) + Eigen::Vector2d(noise(engine), noise(engine));
    if (n >= right) u = kCenter + Eigen::Vector2d(700 * any(engine), 470 * any(engine));
    pairs.push_back({u, X});
  }
  return pairs;
}

Pose tilted(double degrees, double about, double spin) {
  constexpr double kDegree = 0.017453292519943295;
  Pose pose;
  pose.R = geometry::rotation_about(degrees * kDegree * Eigen::Vector3d(std::cos(about), std::sin(about), 0)) *
           geometry::rotation_about({0, 0, spin});
  pose.t = {0.02, -0.03, 0.42};
  return pose;
}

TEST(RadialPose, HalfOfThePairsWrong_TheRightOnesAreFound) {
  const Pose truth = tilted(30, 0.4, 1.0);
  const auto pose = radial_pose(pairs_of(truth, 100, 100, 1), kCenter, 1, 4);
  ASSERT_TRUE(pose);
  EXPECT_GE(pose->inliers.size(), 98U);
  EXPECT_LE(pose->inliers.size(), 112U);
  EXPECT_NEAR(pose->tilt() * 57.29578, 30, 1.5);
  EXPECT_LT((pose->rows.leftCols<2>() - truth.R.topLeftCorner<2, 2>()).norm(), 0.02);
}

TEST(RadialPose, PairsWithoutSense_GiveNothing) {
  EXPECT_FALSE(radial_pose(pairs_of(tilted(30, 0, 0), 0, 200, 2), kCenter, 1, 4));
  EXPECT_FALSE(radial_pose({}, kCenter, 1, 4));
}

TEST(FirstArrangement, TiltedViews_GiveFocalLengthAndPosesWithoutAnyGuess) {
  std::vector<Pose> truth{tilted(30, 0.4, 1.0), tilted(25, 2.5, -2.0), tilted(10, 4.0, 0.1)};
  std::vector<RadialPose> radial;
  std::vector<std::vector<PointPair>> pairs;
  for (std::size_t v = 0; v < truth.size(); ++v) {
    pairs.push_back(pairs_of(truth[v], 300, 30, static_cast<unsigned>(v)));
    radial.push_back(*radial_pose(pairs.back(), kCenter, 1, 3));
    pairs.back() = radial.back().inliers;
  }
  Result<Arrangement> arrangement = first_arrangement(radial, LensKind::kTsai, kCenter, 1);
  ASSERT_TRUE(arrangement) << arrangement.error().text();
  const std::vector<bool> fixed{true, true, true, false, false, false};
  refine_on_points(pairs, fixed, 1, *arrangement);
  EXPECT_NEAR(arrangement->lens[kFirstCoefficient], kF, 2);
  for (std::size_t v = 0; v < truth.size(); ++v) {
    EXPECT_LT((arrangement->poses[v].R - truth[v].R).norm(), 0.01) << "view " << v;
    EXPECT_LT((arrangement->poses[v].t - truth[v].t).norm(), 0.004) << "view " << v;
  }
}

TEST(FirstArrangement, OnlyHeadOn_IsRefusedSinceFocalLengthIsNotDetermined) {
  std::vector<RadialPose> radial;
  for (unsigned v = 0; v < 3; ++v) {
    radial.push_back(*radial_pose(pairs_of(tilted(0, 0, 0.5 * v), 300, 0, v), kCenter, 1, 3));
  }
  const auto refused = first_arrangement(radial, LensKind::kTsai, kCenter, 1);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kNotDetermined);
  EXPECT_NE(refused.error().message.find("head on"), std::string::npos);
}

}  // namespace
}  // namespace nodal::calibration
