// Directions across a ray.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "stitch/geometry/ray.h"

namespace nodal::view {

/// Directions of longitude and latitude at a ray; arbitrary at the poles.
struct Tangent {
  Eigen::Vector3d right, down;
};
inline Tangent tangent_at(const geometry::Ray& ray) {
  const double across = std::hypot(ray.x(), ray.z());
  const Eigen::Vector3d right =
      across > 1e-12 ? Eigen::Vector3d(ray.z() / across, 0, -ray.x() / across) : Eigen::Vector3d(1, 0, 0);
  return {right, ray.direction().cross(right)};
}

}  // namespace nodal::view
