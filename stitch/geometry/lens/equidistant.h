// Equidistant fisheye with a polynomial (§6); may see rays behind the head.
#pragma once

#include <optional>

#include "protocol/calibration.h"
#include "stitch/geometry/lens/rising_polynomial.h"

namespace nodal::geometry {

/// With a the angle from the axis (rad) and r the radius in the original picture (px, aspect taken out):
///   r = f1 a + f2 a^2 + f3 a^3 + ...
/// Ends at its turning point, or at 180 degrees.
class Equidistant {
 public:
  explicit Equidistant(const EquidistantLens& lens);
  double max_angle() const { return radius_of_angle_.max_x(); }
  std::optional<double> radius(double angle) const;
  std::optional<double> angle(double radius) const { return radius_of_angle_.inverse(radius); }
  /// dr/da, px per radian.
  double slope(double angle, double radius) const;

 private:
  RisingPolynomial radius_of_angle_;
};

}  // namespace nodal::geometry
