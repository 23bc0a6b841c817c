#include "stitch/geometry/rising_polynomial.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/polynomial.h"

namespace nodal::geometry {

RisingPolynomial::RisingPolynomial(std::span<const double> coefficients, double max_x)
    : c_(coefficients.begin(), coefficients.end()) {
  std::vector<double> whole{0.0};
  whole.insert(whole.end(), c_.begin(), c_.end());
  max_x_ = rising_until(whole, max_x);
  max_value_ = max_x_ * polynomial_value(c_, max_x_);
}

double RisingPolynomial::value(double x) const { return std::min(x * polynomial_value(c_, x), max_value_); }

double RisingPolynomial::slope(double x) const {
  double slope = 0;
  for (std::size_t k = c_.size(); k-- > 0;) slope = slope * x + static_cast<double>(k + 1) * c_[k];
  return slope;
}

std::optional<double> RisingPolynomial::inverse(double y) const {
  if (!(y >= 0 && y <= max_value_)) return std::nullopt;
  if (y == 0) return 0.0;
  if (y == max_value_) return max_x_;
  double low = 0, high = max_x_;
  double x = std::min(y / c_[0], 0.5 * max_x_);
  constexpr int kMaxSteps = 100;
  for (int step = 0; step < kMaxSteps; ++step) {
    const double error = value(x) - y;
    (error < 0 ? low : high) = x;
    const double steepness = slope(x);
    double next = x - error / steepness;
    // Newton's steps square the error, so that after one this small nothing is left that a double could tell.
    if (steepness > 0 && std::abs(next - x) <= 1e-10 * x) return std::clamp(next, low, high);
    if (!(steepness > 0 && next > low && next < high)) next = low + (high - low) / 2;
    if (next == x) return x;
    x = next;
  }
  return x;
}

}  // namespace nodal::geometry
