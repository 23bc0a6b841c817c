#include "stitch/geometry/head.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "protocol/lens_range.h"
#include "stitch/geometry/rotation.h"

namespace nodal::geometry {
namespace {

/// The cosine of the angle between the axis and the region's farthest point, and a little less.
double cos_reach_of(const HeadCalibration& head, const Lens& lens) {
  constexpr double kRoom = 1.001;  // farthest_radius() and polynomials are not exact to the last digit
  const double radius = kRoom * farthest_radius(head.region, head.center_x, head.center_y, head.aspect);
  return std::cos(std::min(kPi, lens.angle(std::min(radius, lens.max_radius())).value_or(lens.max_angle()) + 1e-6));
}

}  // namespace

Eigen::Vector3d offset_of(const HeadCalibration& head, double distance) {
  if (distance == 0) return Eigen::Vector3d::Zero();
  return Eigen::Vector3d(head.position[0], head.position[1], head.position[2]) / distance;
}

Head::Head(HeadCalibration calibration, Lens lens, const Eigen::Matrix3d& R_head_rig, const Eigen::Vector3d& offset)
    : calibration_(std::move(calibration)),
      lens_(std::move(lens)),
      masks_(calibration_.region),
      R_head_rig_(R_head_rig),
      offset_(offset),
      cos_reach_(cos_reach_of(calibration_, lens_)) {}

Result<Head> Head::make(const HeadCalibration& calibration, double distance) {
  NODAL_TRY(check_head(calibration));
  Result<Lens> lens = Lens::make(calibration.lens, calibration.max_angle);
  if (!lens) return fail(lens.error().in("head '" + calibration.name + "'"));
  Result<Eigen::Matrix3d> R = nearest_rotation(matrix_of(calibration.R_head_rig));
  if (!R) return fail(R.error().in("head '" + calibration.name + "': R_head_rig"));
  return Head(calibration, std::move(*lens), *R, offset_of(calibration, distance));
}

/// offset + t direction is on the unit sphere, t > 0: the offset is inside it.
Eigen::Vector3d Head::seen_from_rig(const Eigen::Vector3d& direction) const {
  if (offset_.isZero(0)) return direction;
  const double along = offset_.dot(direction);
  const double t = std::sqrt(along * along + 1 - offset_.squaredNorm()) - along;
  return offset_ + t * direction;
}

Ray Head::axis() const { return R_head_rig_.transpose() * Ray(); }

Eigen::Vector2d Head::from_center(Pixel pixel) const {
  return {pixel.x - calibration_.center_x, (pixel.y - calibration_.center_y) / calibration_.aspect};
}

std::optional<Pixel> Head::project(const Ray& rig_ray) const {
  const Eigen::Vector3d d = R_head_rig_ * seen_from_here(rig_ray.direction());
  const double s = std::hypot(d.x(), d.y());
  const std::optional<double> r = lens_.radius(std::atan2(s, d.z()));
  if (!r) return std::nullopt;
  if (s == 0) {
    // Exactly behind the head, a lens that sees so far shows a circle and not a pixel.
    if (d.z() < 0) return std::nullopt;
    return Pixel{calibration_.center_x, calibration_.center_y};
  }
  const double q = *r / s;
  return Pixel{calibration_.center_x + q * d.x(), calibration_.center_y + calibration_.aspect * q * d.y()};
}

std::optional<Pixel> Head::pixel_of(const Ray& rig_ray) const {
  if (R_head_rig_.row(2).dot(seen_from_here(rig_ray.direction())) < cos_reach_) return std::nullopt;
  const std::optional<Pixel> pixel = project(rig_ray);
  return pixel && contains(*pixel) ? pixel : std::nullopt;
}

std::optional<Projection> Head::project_with_jacobian(const Ray& rig_ray) const {
  const Eigen::Vector3d d = R_head_rig_ * seen_from_here(rig_ray.direction());
  const double s = std::hypot(d.x(), d.y());
  const double a = std::atan2(s, d.z());
  const std::optional<double> r = lens_.radius(a);
  if (!r) return std::nullopt;
  const double slope = lens_.slope(a, *r);
  Eigen::Matrix<double, 2, 3> J;
  double q = slope;
  if (s < 1e-12) {
    if (d.z() < 0) return std::nullopt;
    J << slope, 0, 0, 0, slope, 0;
  } else {
    // u = q x, v = q y with q = r / s; ds = (x dx + y dy) / s, da = z ds - s dz on the unit sphere.
    q = *r / s;
    const double dq_ds = (slope * d.z() - q) / s;
    const Eigen::RowVector3d dq(dq_ds * d.x() / s, dq_ds * d.y() / s, -slope);
    J.row(0) = d.x() * dq;
    J.row(1) = d.y() * dq;
    J(0, 0) += q;
    J(1, 1) += q;
  }
  J.row(1) *= calibration_.aspect;
  const Pixel pixel{calibration_.center_x + q * d.x(), calibration_.center_y + calibration_.aspect * q * d.y()};
  if (offset_.isZero(0)) return Projection{pixel, J * R_head_rig_};
  // The direction's derivative by the ray: its part across the direction, over the distance.
  const Eigen::Vector3d towards = R_head_rig_.transpose() * d;
  const double per_distance = 1 / (rig_ray.direction() - offset_).norm();
  const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - towards * towards.transpose();
  return Projection{pixel, per_distance * J * R_head_rig_ * across};
}

std::optional<Ray> Head::unproject(Pixel pixel) const {
  const Eigen::Vector2d p = from_center(pixel);
  const double r = p.norm();
  const std::optional<double> a = lens_.angle(r);
  if (!a) return std::nullopt;
  Eigen::Vector3d d(0, 0, 1);
  if (r > 0) d = {std::sin(*a) * p.x() / r, std::sin(*a) * p.y() / r, std::cos(*a)};
  return Ray::towards(seen_from_rig(R_head_rig_.transpose() * d));
}

double Head::distance_to_edge(Pixel pixel) const {
  const double distance = distance_to_edge_without_masks(pixel);
  return masks_.empty() ? distance : masks_.distance(pixel, distance);
}

double Head::distance_to_edge_without_masks(Pixel pixel) const {
  const Region& region = calibration_.region;
  double distance =
      std::min({pixel.x - region.left, region.right - pixel.x, pixel.y - region.top, region.bottom - pixel.y});
  if (region.circle) {
    const double r = std::hypot(pixel.x - region.circle->x, pixel.y - region.circle->y);
    distance = std::min(distance, region.circle->radius - r);
  }
  // The lens's limit is an ellipse if the aspect is not 1; the distance to it is measured along the radius.
  const Eigen::Vector2d p = from_center(pixel);
  const double r = p.norm();
  const double stretch =
      r > 0 && calibration_.aspect != 1 ? Eigen::Vector2d(p.x(), p.y() * calibration_.aspect).norm() / r : 1.0;
  return std::min(distance, (lens_.max_radius() - r) * stretch);
}

double Head::density(Pixel pixel) const {
  const double r = from_center(pixel).norm();
  const std::optional<double> a = lens_.angle(r);
  if (!a) return 0;
  const double slope = lens_.slope(*a, r);
  // On the axis r / sin a tends to the slope.
  const double across = *a > 1e-9 ? r / std::sin(*a) : slope;
  return calibration_.aspect * slope * across;
}

double Head::vignetting(Pixel pixel) const {
  const Vignetting& v = calibration_.vignetting;
  const double x = pixel.x - v.x;
  const double y = (pixel.y - v.y) / calibration_.aspect;
  const double s = (x * x + y * y) / (v.radius * v.radius);
  return 1 + s * (v.coefficients[0] + s * (v.coefficients[1] + s * v.coefficients[2]));
}

Result<std::vector<Head>> make_heads(const Calibration& calibration) {
  NODAL_TRY(check_calibration(calibration));
  std::vector<Head> heads;
  for (const HeadCalibration& head : calibration.heads) {
    NODAL_TRY_ASSIGN(Head made, Head::make(head, calibration.distance));
    heads.push_back(std::move(made));
  }
  return heads;
}

}  // namespace nodal::geometry
