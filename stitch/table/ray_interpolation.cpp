#include "stitch/table/ray_interpolation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace nodal::table {
namespace {

using Point = TangentPlane::Point;

/// Angle / sine, from the squared sine, by a series: the neighbours are so close that it is exact to rounding.
double angle_over_sine(double sine2) {
  if (sine2 < 1e-3) return 1 + sine2 * (1.0 / 6 + sine2 * (3.0 / 40 + sine2 * (15.0 / 336 + sine2 * (105.0 / 3456))));
  const double sine = std::sqrt(std::min(sine2, 1.0));
  return std::asin(sine) / sine;
}

}  // namespace

// Any two orthogonal directions across the ray: the fractions do not depend on the choice.
TangentPlane::TangentPlane(const Eigen::Vector3d& ray) {
  const Eigen::Vector3d aside = std::abs(ray.y()) < 0.7 ? Eigen::Vector3d(0, 1, 0) : Eigen::Vector3d(1, 0, 0);
  e1_ = aside.cross(ray).normalized();
  e2_ = ray.cross(e1_);
}

Point TangentPlane::lay(const Eigen::Vector3d& ray) const {
  const double u = ray.dot(e1_);
  const double v = ray.dot(e2_);
  const double stretch = angle_over_sine(u * u + v * v);
  return {u * stretch, v * stretch};
}

Fractions ray_fractions(const TangentPlane& plane, const std::array<Eigen::Vector3d, 4>& neighbours, Fractions start) {
  std::array<Point, 4> p;
  for (std::size_t k = 0; k < 4; ++k) p[k] = plane.lay(neighbours[k]);
  // Solves p00 + a A + b B + ab C = 0 by Newton's method, from a start that is off by about a thousandth.
  const Point A{p[1].u - p[0].u, p[1].v - p[0].v};
  const Point B{p[2].u - p[0].u, p[2].v - p[0].v};
  const Point C{p[3].u - p[2].u - A.u, p[3].v - p[2].v - A.v};
  const double span = std::abs(A.u * B.v - A.v * B.u);
  if (!(span > 1e-18)) return start;
  double a = start.x;
  double b = start.y;
  constexpr int kMaxSteps = 6;
  for (int step = 0; step < kMaxSteps; ++step) {
    const double fu = p[0].u + a * A.u + b * (B.u + a * C.u);
    const double fv = p[0].v + a * A.v + b * (B.v + a * C.v);
    const double au = A.u + b * C.u;
    const double av = A.v + b * C.v;
    const double bu = B.u + a * C.u;
    const double bv = B.v + a * C.v;
    const double det = au * bv - av * bu;
    if (!(std::abs(det) > span * 1e-3)) return start;
    const double da = (fu * bv - fv * bu) / det;
    const double db = (au * fv - av * fu) / det;
    a -= da;
    b -= db;
    // Each step squares the error: the next step would be below the resolution of a double.
    if (std::abs(da) + std::abs(db) < 1e-6) break;
  }
  return {std::clamp(a, 0.0, 1.0), std::clamp(b, 0.0, 1.0)};
}

}  // namespace nodal::table
