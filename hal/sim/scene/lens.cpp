#include "hal/sim/scene/lens.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace nodal::hal::sim {

namespace {

constexpr int kEntries = 4096;

/// c1 p + c2 p^2 + ...
double power_sum(const std::vector<double>& coefficients, double p) {
  double sum = 0;
  for (std::size_t i = coefficients.size(); i > 0; --i) sum = (sum + coefficients[i - 1]) * p;
  return sum;
}

/// The original radius for parameter p: the angle, or its tangent for rectilinear lenses.
double forward(const LensModel& lens, double p) {
  if (const auto* rectilinear = std::get_if<RectilinearLens>(&lens)) {
    return power_sum(rectilinear->coefficients, p);
  }
  if (const auto* equidistant = std::get_if<EquidistantLens>(&lens)) {
    return power_sum(equidistant->coefficients, p);
  }
  const auto& kb = std::get<KannalaBrandtLens>(lens);
  const double p2 = p * p;
  return kb.focal * p * (1 + p2 * (kb.k[0] + p2 * (kb.k[1] + p2 * (kb.k[2] + p2 * kb.k[3]))));
}

std::vector<double> tsai_angles(const TsaiLens& lens, double step, int count) {
  std::vector<double> angles{0.0};
  double before = 0;
  for (int i = 1; i < count; ++i) {
    const double r = i * step;
    const double ideal = r * (1 + r * r * (lens.kappa1 + r * r * lens.kappa2));
    if (ideal <= before) break;  // the turning point
    before = ideal;
    angles.push_back(std::atan2(ideal, lens.focal));
  }
  return angles;
}

}  // namespace

std::vector<double> angles_by_radius(const LensModel& lens, double step, int count) {
  if (const auto* tsai = std::get_if<TsaiLens>(&lens)) return tsai_angles(*tsai, step, count);
  const bool by_tangent = std::holds_alternative<RectilinearLens>(lens);
  const double p_end = by_tangent ? 1e4 : std::numbers::pi;
  // Every entry starts from the previous one, so that each radius is bracketed on the rising branch: beyond a turning
  // point the model has a second, wrong solution.
  std::vector<double> angles{0.0};
  double p = 0;
  double p_step = 1e-6;
  for (int i = 1; i < count; ++i) {
    const double r = i * step;
    double low = p;
    double high = p;
    double at_high = forward(lens, high);
    while (at_high < r) {
      low = high;
      high = low + p_step;
      const double next = forward(lens, high);
      if (next <= at_high || high > p_end) return angles;
      // Step sizes follow the slope: each is about a quarter of a table entry.
      p_step = std::clamp(p_step * 0.25 * step / (next - at_high), p_step / 2, p_step * 2);
      at_high = next;
    }
    for (int k = 0; k < 60 && low < high; ++k) {
      const double middle = 0.5 * (low + high);
      (forward(lens, middle) < r ? low : high) = middle;
    }
    p = high;
    angles.push_back(by_tangent ? std::atan(p) : p);
  }
  return angles;
}

LensTruth::LensTruth(const HeadCalibration& head)
    : center_x_(head.center_x),
      center_y_(head.center_y),
      aspect_(head.aspect),
      R_head_rig_(head.R_head_rig),
      region_(head.region) {
  double farthest = 0;
  for (const double u : {0.0, double(head.width)}) {
    for (const double v : {0.0, double(head.height)}) farthest = std::max(farthest, radius_of(u, v));
  }
  step_ = farthest / (kEntries - 2);
  const std::vector<double> angles = angles_by_radius(head.lens, step_, kEntries);
  radius_end_ = static_cast<double>(angles.size() - 1) * step_;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const double r = static_cast<double>(i) * step_;
    const double slope = i > 0 ? std::sin(angles[i]) / r : angles.size() > 1 ? angles[1] / step_ : 0;
    table_.push_back({slope, std::cos(angles[i]), angles[i]});
    if (head.max_angle > 0 && angles[i] > head.max_angle) {
      const double part = (head.max_angle - angles[i - 1]) / (angles[i] - angles[i - 1]);
      radius_end_ = r - step_ + part * step_;
      break;
    }
  }
  table_.push_back(table_.back());  // a radius that rounds up to the end reads one entry more
}

double LensTruth::radius_of(double u, double v) const {
  const double x = u - center_x_;
  const double y = (v - center_y_) / aspect_;
  return std::sqrt(x * x + y * y);
}

std::optional<Direction> LensTruth::ray(double u, double v) const {
  if (u < region_.left || u > region_.right || v < region_.top || v > region_.bottom) return std::nullopt;
  if (region_.circle) {
    const double dx = u - region_.circle->x;
    const double dy = v - region_.circle->y;
    if (dx * dx + dy * dy > region_.circle->radius * region_.circle->radius) return std::nullopt;
  }
  const double x = u - center_x_;
  const double y = (v - center_y_) / aspect_;
  const double r = std::sqrt(x * x + y * y);
  if (r >= radius_end_) return std::nullopt;
  const double place = r / step_;
  const auto i = static_cast<std::size_t>(place);
  const double f = place - static_cast<double>(i);
  const double s = table_[i].sine_by_radius * (1 - f) + table_[i + 1].sine_by_radius * f;
  const double c = table_[i].cosine * (1 - f) + table_[i + 1].cosine * f;
  const double hx = x * s;
  const double hy = y * s;
  const auto& R = R_head_rig_;
  return Direction{R[0] * hx + R[3] * hy + R[6] * c, R[1] * hx + R[4] * hy + R[7] * c,
                   R[2] * hx + R[5] * hy + R[8] * c};
}

double LensTruth::footprint(double u, double v) const {
  const double r = radius_of(u, v);
  if (r >= radius_end_) return 0;
  const auto i = static_cast<std::size_t>(r / step_);
  const double radial = (table_[i + 1].angle - table_[i].angle) / step_;
  return std::sqrt(radial * table_[i].sine_by_radius / aspect_);
}

}  // namespace nodal::hal::sim
