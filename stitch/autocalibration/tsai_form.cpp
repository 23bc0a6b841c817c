#include "stitch/autocalibration/tsai_form.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"
#include "stitch/geometry/lens/lens.h"

namespace nodal::autocalibration {
namespace {

constexpr double kFarthestAngle = 70 * kRadiansPerDegree;
constexpr double kMaxDifference = 0.01;  // largest difference, share of the radius
constexpr int kAngles = 100;

/// The largest radius at which the head's picture is used, px, aspect divided out.
double farthest_of(const HeadCalibration& head) {
  const double corner = std::hypot(std::max(head.center_x, head.width - head.center_x),
                                   std::max(head.center_y, head.height - head.center_y) / head.aspect);
  if (!head.region.circle) return corner;
  const Region::Circle& circle = *head.region.circle;
  const double off = std::hypot(circle.x - head.center_x, circle.y - head.center_y);
  return std::min(corner, (circle.radius + off) / std::min(1.0, head.aspect));
}

/// f tan(a) = r (1 + kappa1 r^2 + kappa2 r^4), which is linear in f, kappa1 and kappa2, by least squares.
std::optional<TsaiLens> tsai_of(const geometry::Lens& lens, double farthest) {
  const std::optional<double> edge = lens.angle(farthest);
  if (!edge || *edge > kFarthestAngle) return std::nullopt;
  Eigen::Matrix<double, kAngles, 3> A;
  Eigen::Matrix<double, kAngles, 1> b;
  for (int i = 0; i < kAngles; ++i) {
    const double angle = *edge * (i + 1) / kAngles, r = lens.radius(angle).value_or(0) / farthest;
    const double weight = std::pow(std::cos(angle), 2);  // derivative of the angle by its tangent
    A.row(i) << weight * std::tan(angle), -weight * std::pow(r, 3), -weight * std::pow(r, 5);
    b[i] = weight * r;
  }
  const Eigen::Vector3d found = A.colPivHouseholderQr().solve(b);
  const double square = farthest * farthest;
  const TsaiLens tsai{found[0] * farthest, found[1] / square, found[2] / (square * square)};
  const Result<geometry::Lens> made = geometry::Lens::make(tsai);
  if (!made) return std::nullopt;
  for (int i = 0; i < kAngles; ++i) {
    const double angle = *edge * (i + 1) / kAngles, r = lens.radius(angle).value_or(0);
    const std::optional<double> fitted = made->radius(angle);
    if (!fitted || std::abs(*fitted - r) > kMaxDifference * r) return std::nullopt;
  }
  return tsai;
}

}  // namespace

std::optional<Calibration> with_tsai_lenses(const Calibration& rig) {
  Calibration other = rig;
  for (HeadCalibration& head : other.heads) {
    if (!std::holds_alternative<KannalaBrandtLens>(head.lens)) return std::nullopt;
    const Result<geometry::Lens> lens = geometry::Lens::make(head.lens);
    const std::optional<TsaiLens> tsai = lens ? tsai_of(*lens, farthest_of(head)) : std::nullopt;
    if (!tsai) return std::nullopt;
    head.lens = *tsai;
    head.max_angle = 0;
  }
  return check_calibration(other) ? std::optional(other) : std::nullopt;
}

}  // namespace nodal::autocalibration
