// The highest peak of a correlation over lags.
#pragma once

#include <cstddef>
#include <vector>

#include "stitch/timing/sinc.h"

namespace nodal::timing {

struct Peak {
  std::size_t at = 0;
  double size = 0;
  double second = 0;  ///< the largest value outside the peak
};

/// The highest value, and the highest that is more than `width` places from it.
Peak highest_peak(const std::vector<double>& values, std::size_t width);
/// The highest value, and the highest beyond the valleys to both sides of it.
Peak highest_peak(const std::vector<double>& values);

/// The place of the maximum near `k`, in samples, by a parabola through values an eighth of a sample apart.
double refined_peak(const std::vector<double>& values, std::size_t k, const SincTable& sinc);

/// The same by a parabola through the values at `k` - 1, `k`, `k` + 1: for peaks that are several places wide.
double parabola_peak(const std::vector<double>& values, std::size_t k);

/// The standard deviation of values that are chance but for a few, from their median.
double chance_of(std::vector<double> values);

}  // namespace nodal::timing
