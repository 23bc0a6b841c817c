// Kannala-Brandt fisheye, like OpenCV's fisheye module and Kalibr's "equidistant"; may see rays behind the head.
#pragma once

#include <optional>

#include "protocol/calibration.h"
#include "stitch/geometry/lens/rising_polynomial.h"

namespace nodal::geometry {

/// With a the angle from the axis (rad) and r the radius in the original picture (px, aspect taken out):
///   r = focal (a + k1 a^3 + k2 a^5 + k3 a^7 + k4 a^9)
/// Ends at its turning point, or at 180 degrees.
class KannalaBrandt {
 public:
  explicit KannalaBrandt(const KannalaBrandtLens& lens);
  double max_angle() const { return radius_of_angle_.max_x(); }
  std::optional<double> radius(double angle) const;
  std::optional<double> angle(double radius) const { return radius_of_angle_.inverse(radius); }
  /// dr/da, px per radian.
  double slope(double angle, double radius) const;

 private:
  RisingPolynomial radius_of_angle_;
};

}  // namespace nodal::geometry
