// Polynomials with few real coefficients: turning points, roots and minima. Lenses, responses and vignetting are
// polynomials, and a document is refused when one of them turns back inside its picture.
#pragma once

#include <span>
#include <vector>

namespace nodal {

/// c[0] + c[1] x + c[2] x^2 + ... by Horner's rule; 0 for no coefficients.
double polynomial_value(std::span<const double> c, double x);

std::vector<double> polynomial_derivative(std::span<const double> c);

/// Every real root in [lower, upper], ascending, each once; double roots are found if rounding permits. Coefficients
/// and bounds must be finite. The zero polynomial has no roots here.
std::vector<double> polynomial_roots(std::span<const double> c, double lower, double upper);

/// The largest x in [0, upper] up to which the polynomial rises strictly: its first turning point, or upper. 0 if it
/// does not rise at 0.
double rising_until(std::span<const double> c, double upper);

/// The smallest value on [lower, upper].
double polynomial_minimum(std::span<const double> c, double lower, double upper);

}  // namespace nodal
