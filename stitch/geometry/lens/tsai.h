// Simplified Tsai lens (§4.3): a radial polynomial from the original picture to the ideal one.
#pragma once

#include <optional>

#include "protocol/calibration.h"
#include "stitch/geometry/lens/rising_polynomial.h"

namespace nodal::geometry {

/// With r the radius in the original picture (px, aspect taken out) and a the angle from the axis:
///   r_ideal = r (1 + kappa1 r^2 + kappa2 r^4),   tan a = r_ideal / focal.
/// So angle(r) is a formula and radius(a) its inverse. Ends at its turning point, or at 89.99 degrees.
class Tsai {
 public:
  explicit Tsai(const TsaiLens& lens);
  double max_angle() const { return max_angle_; }
  std::optional<double> radius(double angle) const;
  std::optional<double> angle(double radius) const;
  /// dr/da, px per radian, at an angle whose radius is `radius`.
  double slope(double angle, double radius) const;

 private:
  double focal_;
  RisingPolynomial ideal_of_original_;
  double max_angle_;
};

}  // namespace nodal::geometry
