#include "stitch/autocalibration/unit_lens.h"

#include <cmath>

#include "protocol/base/try.h"

namespace nodal::autocalibration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kPixelsPerUnit = 1000;  // a lens's focal length must be at least one pixel
constexpr double kOnAxis = 1e-9;

}  // namespace

Result<LensRays> LensRays::make(const SharedLens& lens) {
  KannalaBrandtLens model = lens.model;
  model.focal *= kPixelsPerUnit;
  NODAL_TRY_ASSIGN(const geometry::Lens made, geometry::Lens::make(model));
  return LensRays(made, lens);
}

std::optional<double> LensRays::radius(double angle) const {
  const std::optional<double> radius = lens_.radius(angle);
  if (!radius) return std::nullopt;
  return *radius / kPixelsPerUnit;
}

std::optional<double> LensRays::angle(double radius) const { return lens_.angle(kPixelsPerUnit * radius); }

std::optional<Vector3d> LensRays::ray(const Vector2d& at) const {
  const double x = at.x() - shared_.shift.x(), y = (at.y() - shared_.shift.y()) / shared_.aspect, r = std::hypot(x, y);
  const std::optional<double> a = angle(r);
  if (!a) return std::nullopt;
  const double s = r > 0 ? std::sin(*a) / r : 0;
  return Vector3d(s * x, s * y, std::cos(*a));
}

std::optional<Vector2d> LensRays::at(const Vector3d& ray) const {
  const double side = std::hypot(ray.x(), ray.y());
  const std::optional<double> r = radius(std::atan2(side, ray.z()));
  if (!r || (side == 0 && ray.z() < 0)) return std::nullopt;
  const double s = side > 0 ? *r / side : 0;
  return Vector2d(s * ray.x() + shared_.shift.x(), s * ray.y() * shared_.aspect + shared_.shift.y());
}

std::optional<LensRays::RaySlopes> LensRays::ray_slopes(const Vector2d& at) const {
  const double x = at.x() - shared_.shift.x(), y = (at.y() - shared_.shift.y()) / shared_.aspect,
               r = std::max(kOnAxis, std::hypot(x, y));
  const std::optional<double> a = angle(r);
  if (!a) return std::nullopt;
  const double sine = std::sin(*a), cosine = std::cos(*a), focal = shared_.model.focal;
  const Vector2d out(x / r, y / r);
  const double slope = lens_.slope(*a) / kPixelsPerUnit;  // derivative of the radius by the angle
  RaySlopes found{{sine * out.x(), sine * out.y(), cosine}, {}};
  const Vector3d by_angle(cosine * out.x(), cosine * out.y(), -sine);
  const double cube = *a * *a * *a;
  found.by_lens.col(kLogFocal) = -r / slope * by_angle;
  found.by_lens.col(kFirstRadial) = -focal * cube / slope * by_angle;
  found.by_lens.col(kFirstRadial + 1) = -focal * cube * *a * *a / slope * by_angle;
  // By x and y: along the radius the angle changes, across it the direction.
  Eigen::Matrix<double, 3, 2> by_place;
  by_place = by_angle * out.transpose() / slope;
  by_place.topRows<2>() += sine / r * (Eigen::Matrix2d::Identity() - out * out.transpose());
  found.by_lens.col(kLogAspect) = -y * by_place.col(1);
  found.by_lens.col(kShift) = -by_place.col(0);
  found.by_lens.col(kShift + 1) = -by_place.col(1) / shared_.aspect;
  return found;
}

std::optional<LensRays::PointSlopes> LensRays::point_slopes(const Vector3d& ray) const {
  const double side = std::max(kOnAxis, std::hypot(ray.x(), ray.y())), a = std::atan2(side, ray.z());
  const std::optional<double> r = radius(a);
  if (!r) return std::nullopt;
  const double focal = shared_.model.focal, slope = lens_.slope(a) / kPixelsPerUnit;
  const Vector2d out(ray.x() / side, ray.y() / side), place = *r * out;
  PointSlopes found{{place.x() + shared_.shift.x(), place.y() * shared_.aspect + shared_.shift.y()}, {}, {}};
  const double cube = a * a * a;
  found.by_lens.col(kLogFocal) = place;
  found.by_lens.col(kFirstRadial) = focal * cube * out;
  found.by_lens.col(kFirstRadial + 1) = focal * cube * a * a * out;
  found.by_lens.col(kLogAspect) = Vector2d(0, place.y());
  found.by_lens.col(kShift) = Vector2d(1, 0);
  found.by_lens.col(kShift + 1) = Vector2d(0, 1 / shared_.aspect);
  const double square = ray.squaredNorm();
  found.by_ray.leftCols<2>() = slope * ray.z() / square * out * out.transpose() +
                               *r / side * (Eigen::Matrix2d::Identity() - out * out.transpose());
  found.by_ray.col(2) = -slope * side / square * out;
  found.by_lens.row(1) *= shared_.aspect;
  found.by_ray.row(1) *= shared_.aspect;
  return found;
}

}  // namespace nodal::autocalibration
