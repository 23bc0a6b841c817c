// Rays from the nodal point, and pixels. Axes: x right, y down, z forward, for heads and rig alike.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace nodal::geometry {

/// A point of a picture, px. Pixel (i, j) covers [i, i+1) x [j, j+1); its centre is at (i + 1/2, j + 1/2).
struct Pixel {
  double x = 0;
  double y = 0;
  friend bool operator==(const Pixel&, const Pixel&) = default;
};

/// A ray's two angles (§3.1), rad: theta = atan2(X, Z) grows to the right, -pi..pi;
/// phi = atan2(Y, hypot(X, Z)) grows downwards, -pi/2..pi/2.
struct Angles {
  double theta = 0;
  double phi = 0;
  friend bool operator==(const Angles&, const Angles&) = default;
};

/// An angle's sine and cosine.
struct SinCos {
  double sin = 0;
  double cos = 1;
  static SinCos of(double angle) { return {std::sin(angle), std::cos(angle)}; }
};

/// A unit direction from the nodal point.
class Ray {
 public:
  Ray() : direction_(0, 0, 1) {}
  /// The ray along `v`, which may have any length but 0.
  static Ray towards(const Eigen::Vector3d& v);
  static Ray towards(double x, double y, double z) { return towards(Eigen::Vector3d(x, y, z)); }
  static Ray at(Angles angles) { return at(SinCos::of(angles.theta), SinCos::of(angles.phi)); }
  static Ray at(SinCos theta, SinCos phi) {
    return Ray(Eigen::Vector3d(theta.sin * phi.cos, phi.sin, theta.cos * phi.cos));
  }

  const Eigen::Vector3d& direction() const { return direction_; }
  double x() const { return direction_.x(); }
  double y() const { return direction_.y(); }
  double z() const { return direction_.z(); }
  Angles angles() const;

  /// The product R_to_from * ray, where `ray` is in the frame `from`. R must be a rotation.
  friend Ray operator*(const Eigen::Matrix3d& R, const Ray& ray) { return towards(R * ray.direction_); }

 private:
  explicit Ray(const Eigen::Vector3d& unit) : direction_(unit) {}
  Eigen::Vector3d direction_;
};

/// The angle between two rays, rad; accurate for small angles too.
double angle_between(const Ray& a, const Ray& b);

}  // namespace nodal::geometry
