#include "stitch/registration/head_state.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/try.h"
#include "stitch/geometry/lens/lens.h"
#include "stitch/geometry/rotation.h"

namespace nodal::registration {
namespace {

constexpr double kMaxAspectStep = 0.02;  // far from the minimum a step may be much too large

}  // namespace

Slots slots_of(const Sought& sought, int radials) {
  Slots slots;
  const auto take = [&slots](int n) {
    const int first = slots.count;
    slots.count += n;
    return first;
  };
  if (sought.rotation) slots.rotation = take(3);
  if (sought.focal || sought.lens) slots.focal = take(1);
  if (sought.lens) {
    slots.center = take(2);
    slots.radial = take(radials);
    slots.radials = radials;
  }
  if (sought.aspect) slots.aspect = take(1);
  if (sought.nearness) slots.nearness = take(1);
  if (sought.gain) {
    slots.gain = take(sought.channels);
    slots.gains = sought.channels;
  }
  if (sought.vignetting) slots.vignetting = take(kVignettingTerms);
  return slots;
}

double focal_of(const LensModel& lens) {
  if (const auto* tsai = std::get_if<TsaiLens>(&lens)) return tsai->focal;
  if (const auto* kb = std::get_if<KannalaBrandtLens>(&lens)) return kb->focal;
  if (const auto* equidistant = std::get_if<EquidistantLens>(&lens)) return equidistant->coefficients.front();
  return std::get<RectilinearLens>(lens).coefficients.front();
}

double farthest_radius(const Region& region, double center_x, double center_y, double aspect) {
  double farthest = 0;
  for (const double x : {region.left, region.right}) {
    for (const double y : {region.top, region.bottom}) {
      farthest = std::max(farthest, std::hypot(x - center_x, (y - center_y) / aspect));
    }
  }
  if (region.circle) {
    const double off = std::hypot(region.circle->x - center_x, (region.circle->y - center_y) / aspect);
    farthest = std::min(farthest, off + region.circle->radius / std::min(aspect, 1.0));
  }
  return farthest;
}

Result<double> HeadState::used_angle() const {
  NODAL_TRY_ASSIGN(const geometry::Lens made, geometry::Lens::make(lens, max_angle));
  return made.angle(farthest_radius(region, center_x, center_y, aspect)).value_or(made.max_angle());
}

Result<HeadState> HeadState::from(const HeadCalibration& head, double distance) {
  HeadState state;
  state.position = {head.position[0], head.position[1], head.position[2]};
  if (distance > 0) state.nearness = 1 / distance;
  state.q_head_rig = Eigen::Quaterniond(geometry::matrix_of(head.R_head_rig)).normalized();
  state.lens = head.lens;
  state.center_x = head.center_x;
  state.center_y = head.center_y;
  for (std::size_t c = 0; c < 3; ++c) state.log_gain[c] = std::log(head.gain[c]);
  state.aspect = head.aspect;
  state.max_angle = head.max_angle;
  state.region = head.region;
  if (!head.region.masks.empty()) state.masks = std::make_shared<MaskField>(head);
  state.edge_radius = farthest_radius(head.region, head.center_x, head.center_y, head.aspect);
  const Result<double> angle = state.used_angle();
  if (!angle) return fail(angle.error().in("head '" + head.name + "'"));
  state.edge_angle = *angle;
  state.vignetting = head.vignetting.coefficients;
  if (state.vignetting == std::array<double, 3>{}) {
    // No fall-off in the prior, so its centre and radius are not set. The centre becomes the lens's, the radius the
    // region's, so that a fall-off shared by equal heads is the same function for all of them.
    const Region& region = head.region;
    const double across = region.right - region.left, down = (region.bottom - region.top) / head.aspect;
    state.vignetting_radius = std::hypot(across, down) / 2;
    if (region.circle) state.vignetting_radius = std::min(state.vignetting_radius, region.circle->radius);
  } else {
    state.vignetting_x = head.vignetting.x - head.center_x;
    state.vignetting_y = head.vignetting.y - head.center_y;
    state.vignetting_radius = head.vignetting.radius;
  }
  return state;
}

HeadCalibration HeadState::into(HeadCalibration prior) const {
  prior.R_head_rig = geometry::rows_of(q_head_rig.normalized().toRotationMatrix());
  prior.lens = lens;
  prior.center_x = center_x;
  prior.center_y = center_y;
  prior.aspect = aspect;
  for (std::size_t c = 0; c < 3; ++c) prior.gain[c] = std::exp(log_gain[c]);
  prior.vignetting = {center_x + vignetting_x, center_y + vignetting_y, vignetting_radius, vignetting};
  return prior;
}

double light_left(const std::array<double, 3>& vignetting, double s) {
  return 1 + s * (vignetting[0] + s * (vignetting[1] + s * vignetting[2]));
}

bool plausible_fall_off(const std::array<double, 3>& vignetting) {
  constexpr double kRounding = 1e-6;
  return std::ranges::all_of(kFallOffPlaces, [&](double s) {
    const double left = light_left(vignetting, s);
    return left >= kMinLight - kRounding && left <= kMaxLight + kRounding;
  });
}

HeadState moved(const HeadState& head, const Slots& slots, const Eigen::VectorXd& step) {
  HeadState next = head;
  if (slots.rotation >= 0) {
    const Eigen::Matrix3d turn = geometry::rotation_about(step.segment<3>(slots.rotation));
    next.q_head_rig = (Eigen::Quaterniond(turn) * head.q_head_rig).normalized();
  }
  if (slots.focal >= 0) {
    std::vector<double> radial;
    radial.reserve(static_cast<std::size_t>(slots.radials));
    for (int k = 0; k < slots.radials; ++k) radial.push_back(step[slots.radial + k]);
    // Far from the minimum a step may be much too large; it is limited, and the next step corrects it.
    const double log_focal = std::clamp(step[slots.focal], -0.1, 0.1);
    const bool moves = log_focal != 0 || std::ranges::any_of(radial, [](double each) { return each != 0; });
    if (moves) next.lens = changed_lens(head.lens, log_focal, radial, head.edge_angle, head.edge_radius);
  }
  if (slots.center >= 0) {
    next.center_x += step[slots.center];
    next.center_y += step[slots.center + 1];
  }
  if (slots.aspect >= 0) next.aspect += std::clamp(step[slots.aspect], -kMaxAspectStep, kMaxAspectStep);
  if (slots.nearness >= 0) next.nearness = std::max(0.0, head.nearness + step[slots.nearness]);
  for (int c = 0; c < 3 && slots.gain >= 0; ++c) {
    next.log_gain[static_cast<std::size_t>(c)] += step[slots.gain + std::min(c, slots.gains - 1)];
  }
  if (slots.vignetting >= 0) {
    // A step to an implausible fall-off is shortened, in the end to zero; not if the start is implausible already.
    for (double share = 1; share > 1e-3; share /= 2) {
      for (std::size_t k = 0; k < kVignettingTerms; ++k) {
        next.vignetting[k] = head.vignetting[k] + share * step[slots.vignetting + static_cast<Eigen::Index>(k)];
      }
      if (plausible_fall_off(next.vignetting) || !plausible_fall_off(head.vignetting)) break;
      next.vignetting = head.vignetting;
    }
  }
  return next;
}

}  // namespace nodal::registration
