#include "stitch/registration/pair_errors.h"

#include "protocol/base/try.h"
#include "stitch/registration/descent.h"

namespace nodal::registration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kFocalStep = 1e-5;

Result<geometry::Head> head_with(HeadCalibration head, double log_focal) {
  head.R_head_rig = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  if (log_focal != 0) {
    head.lens = changed_lens(head.lens, log_focal, {}, 1, 1);
    head.max_angle = 0;
  }
  return geometry::Head::make(head);
}

Matrix3d cross(const Vector3d& r) {
  Matrix3d m;
  m << 0, -r.z(), r.y(), r.z(), 0, -r.x(), -r.y(), r.x(), 0;
  return m;
}

}  // namespace

Result<Lenses> make_lenses(const Calibration& prior, const std::vector<double>& log_focal, bool focals) {
  Lenses lenses;
  for (std::size_t h = 0; h < prior.heads.size(); ++h) {
    NODAL_TRY_ASSIGN(geometry::Head at, head_with(prior.heads[h], log_focal[h]));
    lenses.push_back({std::move(at), {}, {}});
    if (!focals) continue;
    NODAL_TRY_ASSIGN(lenses.back().above, head_with(prior.heads[h], log_focal[h] + kFocalStep));
    NODAL_TRY_ASSIGN(lenses.back().below, head_with(prior.heads[h], log_focal[h] - kFocalStep));
  }
  return lenses;
}

std::optional<SeenEnd> seen_in(const std::vector<Matrix3d>& R_head_rig, const Lenses& lenses, const PairEnd& from,
                               const PairEnd& to) {
  const HeadLens &source = lenses[from.head], &target = lenses[to.head];
  const std::optional<geometry::Ray> from_ray = source.at.unproject(from.pixel);
  if (!from_ray) return std::nullopt;
  const Matrix3d R_to_from = R_head_rig[to.head] * R_head_rig[from.head].transpose();
  const Vector3d direction = R_to_from * from_ray->direction();
  const geometry::Ray ray = geometry::Ray::towards(direction);
  const auto at = target.at.project_with_jacobian(ray);
  if (!at) return std::nullopt;
  const Eigen::Matrix<double, 2, 3> by_direction = at->J / to.pixels_per_radian;
  SeenEnd seen;
  seen.error = Eigen::Vector2d(at->pixel.x - to.pixel.x, at->pixel.y - to.pixel.y) / to.pixels_per_radian;
  // If the head `from` turns by w, its ray r is that of r - w x r = r + r x w before; a turn of `to` adds w x
  // direction.
  seen.by_turn_from = by_direction * R_to_from * cross(from_ray->direction());
  seen.by_turn_to = -by_direction * cross(direction);
  if (!source.above || !target.above) return seen;
  const auto longer = source.above->unproject(from.pixel), shorter = source.below->unproject(from.pixel);
  if (longer && shorter) {
    seen.by_focal_from = by_direction * R_to_from * (longer->direction() - shorter->direction()) / (2 * kFocalStep);
  }
  const auto outer = target.above->project(ray), inner = target.below->project(ray);
  if (outer && inner) {
    const Eigen::Vector2d moved(outer->x - inner->x, outer->y - inner->y);
    seen.by_focal_to = moved / (2 * kFocalStep * to.pixels_per_radian);
  }
  return seen;
}

}  // namespace nodal::registration
