// How evenly points are spread on the sphere.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace nodal::test {

/// The squared discrepancy of unit vectors: the squared difference between the part of them in a cap and the cap's part
/// of the sphere, its mean over all axes, integrated over the cosine of the cap's radius from -1 to 1. By Stolarsky's
/// invariance principle (1973) it is (4/3 - the mean distance of two points, each with itself included) / 4. For n
/// independent points it is 1 / (3 n) on average.
inline double squared_discrepancy(const std::vector<Eigen::Vector3d>& points) {
  double sum = 0;
  for (std::size_t a = 0; a < points.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) sum += (points[a] - points[b]).norm();
  }
  const auto n = static_cast<double>(points.size());
  return (4.0 / 3 - 2 * sum / n / n) / 4;
}

}  // namespace nodal::test
