// Ray interpolation (§4.5): the position of a ray between the rays of four neighbouring samples, on the sphere.
#pragma once

#include <Eigen/Core>
#include <array>

namespace nodal::table {

/// The shares of the right column and of the lower row, 0..1.
struct Fractions {
  double x = 0;
  double y = 0;
};

/// The plane tangent to the sphere at a ray. The logarithm map projects nearby rays onto it and preserves their
/// direction and angle from that ray.
class TangentPlane {
 public:
  explicit TangentPlane(const Eigen::Vector3d& ray);

  struct Point {
    double u = 0;  ///< rad
    double v = 0;
  };
  /// `ray` is within a radian of the plane's own.
  Point lay(const Eigen::Vector3d& ray) const;

 private:
  Eigen::Vector3d e1_;
  Eigen::Vector3d e2_;
};

/// The fractions (a, b) for which the bilinear mean of the neighbours is the plane's own ray:
///   (1-a)(1-b) p00 + a(1-b) p10 + (1-a)b p01 + ab p11 = 0
/// On an axis through the principal point of an ideal pinhole this is the paper's
/// (atan(x/f) - atan(x0/f)) / (atan(x1/f) - atan(x0/f)).
///
/// neighbours: unit rays of the samples at (0,0), (1,0), (0,1), (1,1). `start` is the initial value, preferably the
/// pixel's fractions; it is returned where the neighbours span no area.
Fractions ray_fractions(const TangentPlane& plane, const std::array<Eigen::Vector3d, 4>& neighbours, Fractions start);

}  // namespace nodal::table
