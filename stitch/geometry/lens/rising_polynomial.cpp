#include "stitch/geometry/lens/rising_polynomial.h"

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
  constexpr std::size_t kKnots = 257;
  knot_step_ = max_x_ / static_cast<double>(kKnots - 1);
  for (std::size_t k = 0; k < kKnots; ++k) knots_.push_back(value(static_cast<double>(k) * knot_step_));
}

double RisingPolynomial::value(double x) const { return std::min(x * polynomial_value(c_, x), max_value_); }

double RisingPolynomial::slope(double x) const {
  double slope = 0;
  for (std::size_t k = c_.size(); k > 0; --k) slope = slope * x + static_cast<double>(k) * c_[k - 1];
  return slope;
}

std::optional<double> RisingPolynomial::inverse(double y) const {
  if (!(y >= 0 && y <= max_value_)) return std::nullopt;
  if (y == 0) return 0.0;
  if (y == max_value_) return max_x_;
  const auto above = std::upper_bound(knots_.begin(), knots_.end() - 1, y);
  const double cell = static_cast<double>(above - knots_.begin());
  double low = (cell - 1) * knot_step_, high = std::min(cell * knot_step_, max_x_);
  double x = low + (high - low) * std::clamp((y - *(above - 1)) / (*above - *(above - 1)), 0.0, 1.0);
  double last = high - low;
  constexpr int kMaxSteps = 100;
  for (int step = 0; step < kMaxSteps; ++step) {
    const double error = value(x) - y;
    (error < 0 ? low : high) = x;
    const double steepness = slope(x);
    double next = x - error / steepness;
    // Newton's steps square the error, so after one this small the rest is below a double's precision.
    if (steepness > 0 && std::abs(next - x) <= 1e-10 * x) return std::clamp(next, low, high);
    if (!(steepness > 0 && next >= low && next <= high)) next = low + (high - low) / 2;
    const double move = std::abs(next - x);
    // At a turning point each step is about half the one before; when that stops, the steps are rounding noise.
    if (move <= 2e-16 * next || (step > 2 && move > 0.9 * last)) return next;
    last = move;
    x = next;
  }
  return x;
}

}  // namespace nodal::geometry
