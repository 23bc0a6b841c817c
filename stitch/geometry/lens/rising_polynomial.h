// A polynomial through zero that rises over its whole domain, and its inverse; all lens models here use it.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace nodal::geometry {

/// p(x) = c1 x + c2 x^2 + ... on [0, max_x], rising there.
class RisingPolynomial {
 public:
  /// `coefficients` are c1, c2, ... The domain ends at max_x or at the first turning point before it.
  RisingPolynomial(std::span<const double> coefficients, double max_x);

  double max_x() const { return max_x_; }
  double max_value() const { return max_value_; }

  /// The value at x in the domain. At most max_value(), even where rounding near a turning point would exceed it.
  double value(double x) const;
  /// The derivative at x in the domain.
  double slope(double x) const;

  /// The x in [0, max_x] with p(x) = y; nothing for y outside [0, max_value]. Newton's method from a table's estimate;
  /// every step stays inside a bisection bracket, so it also converges at a turning point (slope 0).
  std::optional<double> inverse(double y) const;

 private:
  std::vector<double> c_;  // c_[k] multiplies x^(k+1)
  double max_x_ = 0;
  double max_value_ = 0;
  double knot_step_ = 0;
  std::vector<double> knots_;  // p at multiples of knot_step_, up to max_x
};

}  // namespace nodal::geometry
