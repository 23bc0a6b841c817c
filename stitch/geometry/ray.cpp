#include "stitch/geometry/ray.h"

#include <Eigen/Geometry>
#include <cmath>

#include "protocol/base/result.h"

namespace nodal::geometry {

Ray Ray::towards(const Eigen::Vector3d& v) {
  const double length = v.norm();
  NODAL_ASSERT(length > 0);
  return Ray(v / length);
}

Angles Ray::angles() const { return {std::atan2(x(), z()), std::atan2(y(), std::hypot(x(), z()))}; }

double angle_between(const Ray& a, const Ray& b) {
  return std::atan2(a.direction().cross(b.direction()).norm(), a.direction().dot(b.direction()));
}

}  // namespace nodal::geometry
