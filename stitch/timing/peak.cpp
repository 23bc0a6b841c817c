#include "stitch/timing/peak.h"

#include <algorithm>
#include <cmath>

#include "stitch/solve/robust.h"

namespace nodal::timing {
namespace {

/// The peak with everything from `low` to `high` counted as its own.
Peak peak_within(const std::vector<double>& values, std::size_t at, std::size_t low, std::size_t high) {
  Peak peak{.at = at, .size = values[at]};
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (k < low || k > high) peak.second = std::max(peak.second, values[k]);
  }
  return peak;
}

std::size_t highest(const std::vector<double>& values) {
  return static_cast<std::size_t>(std::ranges::max_element(values) - values.begin());
}

/// Where the parabola through values at -1, 0 and 1 is highest, -1 .. 1.
double vertex(double left, double here, double right) {
  const double curve = left - 2 * here + right;
  return curve < 0 ? std::clamp(0.5 * (left - right) / curve, -1.0, 1.0) : 0.0;
}

}  // namespace

Peak highest_peak(const std::vector<double>& values, std::size_t width) {
  if (values.empty()) return {};
  const std::size_t at = highest(values);
  return peak_within(values, at, at - std::min(at, width), at + width);
}

Peak highest_peak(const std::vector<double>& values) {
  if (values.empty()) return {};
  const std::size_t at = highest(values);
  std::size_t low = at, high = at;
  while (low > 0 && values[low - 1] <= values[low]) --low;
  while (high + 1 < values.size() && values[high + 1] <= values[high]) ++high;
  return peak_within(values, at, low, high);
}

double refined_peak(const std::vector<double>& values, std::size_t k, const SincTable& sinc) {
  const double step = 1.0 / 8;
  const auto value = [&](double place) { return sinc.value(values, place); };
  double best = static_cast<double>(k);
  for (int i = -8; i <= 8; ++i) {
    const double place = static_cast<double>(k) + i * step;
    if (value(place) > value(best)) best = place;
  }
  return best + step * vertex(value(best - step), value(best), value(best + step));
}

double parabola_peak(const std::vector<double>& values, std::size_t k) {
  if (k == 0 || k + 1 >= values.size()) return static_cast<double>(k);
  return static_cast<double>(k) + vertex(values[k - 1], values[k], values[k + 1]);
}

double chance_of(std::vector<double> values) {
  for (double& x : values) x = std::abs(x);
  return solve::kSigmaPerMedian * solve::median(values);
}

}  // namespace nodal::timing
