// Robust statistics: weights for outliers, and a scale that outliers do not affect.
#pragma once

#include <vector>

namespace nodal::solve {

/// Huber's norm: quadratic up to `limit`, linear beyond.
struct Huber {
  double limit;
  /// Of a residual's square in a least-squares problem with the same gradient.
  double weight(double size) const { return size <= limit ? 1.0 : limit / size; }
  double cost(double size) const { return size <= limit ? size * size : limit * (2 * size - limit); }
};

/// The middle one of `values`, which it reorders; the upper one of two. 0 when there are none.
double median(std::vector<double>& values);

/// For a normal distribution, the standard deviation is this many medians of the absolute value.
inline constexpr double kSigmaPerMedian = 1.4826;

}  // namespace nodal::solve
