#include "protocol/base/polynomial.h"

#include <algorithm>
#include <cmath>

namespace nodal {
namespace {

/// The root between a and b, where p has opposite signs; exact to the last bit.
double bisect(std::span<const double> c, double a, double b) {
  const bool rising = polynomial_value(c, a) < 0;
  for (int step = 0; step < 2000; ++step) {
    const double middle = a + (b - a) / 2;
    if (middle <= a || middle >= b) break;
    if ((polynomial_value(c, middle) < 0) == rising) {
      a = middle;
    } else {
      b = middle;
    }
  }
  return b;
}

void add_root(std::vector<double>& roots, double root) {
  if (roots.empty() || root > roots.back()) roots.push_back(root);
}

}  // namespace

double polynomial_value(std::span<const double> c, double x) {
  double value = 0;
  for (std::size_t k = c.size(); k > 0; --k) value = value * x + c[k - 1];
  return value;
}

std::vector<double> polynomial_derivative(std::span<const double> c) {
  std::vector<double> d;
  for (std::size_t k = 1; k < c.size(); ++k) d.push_back(static_cast<double>(k) * c[k]);
  return d;
}

std::vector<double> polynomial_roots(std::span<const double> c, double lower, double upper) {
  while (!c.empty() && c.back() == 0) c = c.first(c.size() - 1);
  if (c.size() < 2 || !(lower <= upper)) return {};
  // Between two neighbouring turning points the polynomial is monotone and has at most one root.
  std::vector<double> cuts{lower};
  for (const double x : polynomial_roots(polynomial_derivative(c), lower, upper)) add_root(cuts, x);
  add_root(cuts, upper);
  std::vector<double> roots;
  for (std::size_t k = 0; k < cuts.size(); ++k) {
    const double here = polynomial_value(c, cuts[k]);
    if (here == 0) add_root(roots, cuts[k]);
    if (k + 1 == cuts.size()) break;
    const double next = polynomial_value(c, cuts[k + 1]);
    if ((here < 0 && next > 0) || (here > 0 && next < 0)) add_root(roots, bisect(c, cuts[k], cuts[k + 1]));
  }
  return roots;
}

double rising_until(std::span<const double> c, double upper) {
  const std::vector<double> slope = polynomial_derivative(c);
  if (!(polynomial_value(slope, 0) > 0)) return 0;
  const std::vector<double> turns = polynomial_roots(slope, 0, upper);
  return turns.empty() ? upper : turns.front();
}

double polynomial_minimum(std::span<const double> c, double lower, double upper) {
  double lowest = std::min(polynomial_value(c, lower), polynomial_value(c, upper));
  for (const double x : polynomial_roots(polynomial_derivative(c), lower, upper)) {
    lowest = std::min(lowest, polynomial_value(c, x));
  }
  return lowest;
}

}  // namespace nodal
