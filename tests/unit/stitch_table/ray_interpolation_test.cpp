#include "stitch/table/ray_interpolation.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

namespace nodal::table {
namespace {

/// The ray of a point of an ideal pinhole's picture, relative to the principal point.
Eigen::Vector3d pinhole(double x, double y, double focal) { return Eigen::Vector3d(x, y, focal).normalized(); }

std::array<Eigen::Vector3d, 4> neighbours(double x, double y, double focal) {
  return {pinhole(x, y, focal), pinhole(x + 1, y, focal), pinhole(x, y + 1, focal), pinhole(x + 1, y + 1, focal)};
}

/// The formula in §4.5, as printed.
double papers_alpha(double x, double focal) {
  const double below = std::atan(std::floor(x) / focal);
  return (std::atan(x / focal) - below) / (std::atan(std::ceil(x) / focal) - below);
}

TEST(RayFractions, OnAnAxisOfAnIdealPinhole_AreThePapersArctangents) {
  for (const double focal : {3.0, 20.0, 490.0}) {
    for (const double x : {-7.75, -0.5, 0.25, 1.5, 2.9, 11.625}) {
      const double x0 = std::floor(x);
      const Fractions across = ray_fractions(TangentPlane(pinhole(x, 0, focal)), neighbours(x0, 0, focal), {x - x0, 0});
      EXPECT_NEAR(across.x, papers_alpha(x, focal), 1e-12) << x << " at focal " << focal;
      EXPECT_NEAR(across.y, 0, 1e-12);
      const Fractions down = ray_fractions(TangentPlane(pinhole(0, x, focal)), neighbours(0, x0, focal), {0, x - x0});
      EXPECT_NEAR(down.y, papers_alpha(x, focal), 1e-12);
      EXPECT_NEAR(down.x, 0, 1e-12);
    }
  }
}

TEST(RayFractions, FocalGrowing_BecomeThePixelsFractions) {
  for (const double focal : {1e2, 1e4, 1e6}) {
    const TangentPlane plane(pinhole(30.3, -12.8, focal));
    const Fractions at = ray_fractions(plane, neighbours(30, -13, focal), {0.3, 0.2});
    EXPECT_NEAR(at.x, 0.3, 0.5 / focal);
    EXPECT_NEAR(at.y, 0.2, 0.5 / focal);
  }
  // At a short focal length they differ: linear interpolation of rays is not linear interpolation of pixels.
  EXPECT_GT(std::abs(papers_alpha(2.5, 3.0) - 0.5), 0.02);
}

TEST(RayFractions, RayOfANeighbour_IsThatNeighbour) {
  const std::array<Eigen::Vector3d, 4> at = neighbours(40, 25, 60);
  for (std::size_t k = 0; k < 4; ++k) {
    const Fractions found = ray_fractions(TangentPlane(at[k]), at, {0.5, 0.5});
    EXPECT_NEAR(found.x, k % 2 == 1 ? 1.0 : 0.0, 1e-12);
    EXPECT_NEAR(found.y, k / 2 == 1 ? 1.0 : 0.0, 1e-12);
  }
}

TEST(RayFractions, NeighboursWithoutArea_ReturnTheStart) {
  const Eigen::Vector3d one(0, 0, 1);
  const Fractions at = ray_fractions(TangentPlane(one), {one, one, one, one}, {0.25, 0.75});
  EXPECT_EQ(at.x, 0.25);
  EXPECT_EQ(at.y, 0.75);
}

RC_GTEST_PROP(RayFractions, AnyRayBetweenItsNeighbours_IsTheirBilinearMeanOnTheSphere, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  const double focal = uniform(5, 1000);
  const double x = std::floor(uniform(-1, 1) * focal);
  const double y = std::floor(uniform(-1, 1) * focal);
  const double a = uniform(0, 1);
  const double b = uniform(0, 1);
  // In any rotation, because the result must not depend on the ray's direction.
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(0.1, 1)).normalized();
  const Eigen::Vector3d ray = turn * pinhole(x + a, y + b, focal);
  std::array<Eigen::Vector3d, 4> around = neighbours(x, y, focal);
  for (Eigen::Vector3d& neighbour : around) neighbour = turn * neighbour;

  const Fractions at = ray_fractions(TangentPlane(ray), around, {a, b});
  // Each neighbour as direction times angle from the ray: the definition of the logarithm map.
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  const double shares[] = {(1 - at.x) * (1 - at.y), at.x * (1 - at.y), (1 - at.x) * at.y, at.x * at.y};
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector3d across = around[k] - ray * ray.dot(around[k]);
    const double angle = std::atan2(across.norm(), ray.dot(around[k]));
    if (across.norm() > 0) mean += shares[k] * angle * across.normalized();
  }
  RC_ASSERT(mean.norm() * focal < 1e-9);  // px
}

}  // namespace
}  // namespace nodal::table
