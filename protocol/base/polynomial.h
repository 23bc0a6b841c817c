// Polynomials with few real coefficients: where they stop rising, and how low they get. Lenses, responses and
// vignetting are polynomials, and a document is refused when one of them turns back inside its picture.
#pragma once

#include <span>
#include <vector>

namespace nodal {

/// c[0] + c[1] x + c[2] x^2 + ... by Horner's rule; 0 for no coefficients.
double polynomial_value(std::span<const double> c, double x);

std::vector<double> polynomial_derivative(std::span<const double> c);

/// Every real root in [lower, upper], rising, each once; roots that only touch zero are found when rounding
/// lets them. Coefficients and bounds must be finite. No roots for the polynomial that is zero everywhere.
std::vector<double> polynomial_roots(std::span<const double> c, double lower, double upper);

/// The largest x in [0, upper] up to which the polynomial rises strictly: its first turning point, or upper.
/// 0 when it does not even begin to rise.
double rising_until(std::span<const double> c, double upper);

/// The smallest value on [lower, upper].
double polynomial_minimum(std::span<const double> c, double lower, double upper);

}  // namespace nodal
