// Rectilinear lens with a radial polynomial from the ideal picture to the original one.
#pragma once

#include <optional>

#include "protocol/calibration.h"
#include "stitch/geometry/lens/rising_polynomial.h"

namespace nodal::geometry {

/// With t = tan a, a the angle from the axis, and r the radius in the original picture (px, aspect taken out):
///   r = c1 t + c2 t^2 + c3 t^3 + ...
/// c1 is the focal length in px. Ends at its turning point, or at 89.99 degrees.
class Rectilinear {
 public:
  explicit Rectilinear(const RectilinearLens& lens);
  double max_angle() const;
  std::optional<double> radius(double angle) const;
  std::optional<double> angle(double radius) const;
  /// dr/da, px per radian.
  double slope(double angle, double radius) const;

 private:
  RisingPolynomial radius_of_tangent_;
};

}  // namespace nodal::geometry
