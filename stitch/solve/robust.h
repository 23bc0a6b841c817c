// Robust statistics: weights for outliers, and a scale that outliers do not affect.
#pragma once

#include <vector>

namespace nodal::solve {

/// Huber's norm: quadratic up to `limit`, linear beyond.
struct Huber {
  double limit;
  /// The weight of the squared residual for which a least-squares problem has the same gradient.
  double weight(double size) const { return size <= limit ? 1.0 : limit / size; }
  double cost(double size) const { return size <= limit ? size * size : limit * (2 * size - limit); }
};

/// The median of `values`, the upper one for an even count; reorders them. 0 if empty.
double median(std::vector<double>& values);

/// For a normal distribution: standard deviation / median of the absolute value.
inline constexpr double kSigmaPerMedian = 1.4826;

}  // namespace nodal::solve
