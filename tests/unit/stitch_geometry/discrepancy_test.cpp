// How evenly the rays of scattered layouts are spread (§5, Figure 6).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "raymap_examples.h"
#include "stitch/geometry/raymap/layout.h"
#include "tests/reference/discrepancy.h"

namespace nodal::geometry {
namespace {

/// Squared.
double discrepancy_of(std::string_view name, int width, int height) {
  const auto layout = made(name, width, height);
  std::vector<Eigen::Vector3d> rays;
  for (int j = 0; j < height; ++j) {
    for (int i = 0; i < width; ++i) rays.push_back(layout->ray(i + 0.5, j + 0.5)->direction());
  }
  return test::squared_discrepancy(rays);
}

TEST(Discrepancy, OfIndependentRays_IsOneOverThreeN) {
  // The variance of the part in a cap with the part p of the sphere is p (1 - p) / n; its integral is 1 / (3 n).
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  constexpr int kSets = 60, kRays = 500;
  double mean = 0;
  for (int set = 0; set < kSets; ++set) {
    std::vector<Eigen::Vector3d> rays;
    for (int k = 0; k < kRays; ++k) {
      rays.push_back(Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized());
    }
    mean += test::squared_discrepancy(rays) / kSets;
  }
  EXPECT_NEAR(mean * 3 * kRays, 1, 0.25);
}

TEST(Discrepancy, OfHammersleyAndHalton_FallsAsFastAsThatOfAnyPointsCan) {
  // No points do better than the order n^(-3/4) (Beck 1984); independent ones have n^(-1/2).
  for (const std::string_view name : {"hammersley", "halton"}) {
    const double coarse = std::sqrt(discrepancy_of(name, 32, 32));
    const double fine = std::sqrt(discrepancy_of(name, 128, 128));
    EXPECT_NEAR(std::log(coarse / fine) / std::log(16), 0.75, 0.06) << name;
    EXPECT_LT(fine * 8, 1 / std::sqrt(3.0 * 128 * 128)) << name << ": an eighth of that of independent rays";
  }
}

/// The part of the circle of latitude with the sine `u` in the cap about an axis with the sine of latitude `axis`.
double part_in_cap(double u, double axis, double cosine) {
  const double across = std::sqrt((1 - axis * axis) * (1 - u * u));
  return std::acos(std::clamp((cosine - u * axis) / across, -1.0, 1.0)) / kPi;
}

TEST(Discrepancy, OfStratifiedRandom_IsThatOfRowsWithIndependentLongitudes) {
  // Rows are even, and a row's rays are in a cap with the part p of its circle: the variance is the mean of p (1 - p) /
  // n.
  constexpr int kSteps = 100;
  double integral = 0;
  for (int a = 0; a < kSteps; ++a) {
    for (int c = 0; c < kSteps; ++c) {
      for (int r = 0; r < kSteps; ++r) {
        const auto middle = [](int k) { return 2 * (k + 0.5) / kSteps - 1; };
        const double p = part_in_cap(middle(r), middle(a), middle(c));
        integral += 2 * p * (1 - p) / (kSteps * kSteps * kSteps);
      }
    }
  }
  EXPECT_LT(integral, 1.0 / 3) << "rows of equal area make it better than independent rays, but not by much";
  constexpr int kSets = 40, kWidth = 30, kHeight = 20;
  double mean = 0;
  for (int seed = 1; seed <= kSets; ++seed) {
    mean += discrepancy_of("stratified_random:seed=" + std::to_string(seed), kWidth, kHeight) / kSets;
  }
  EXPECT_NEAR(mean * kWidth * kHeight / integral, 1, 0.25);
}

}  // namespace
}  // namespace nodal::geometry
