#include "hal/sim/scene/plate.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace nodal::hal::sim {

namespace {

Direction cross(const Direction& a, const Direction& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Rotates `d` about the unit vector `axis` (Rodrigues).
Direction turned(const Direction& d, const Direction& axis, double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const Direction side = cross(axis, d);
  const double along = dot(axis, d) * (1 - c);
  return {d.x * c + side.x * s + axis.x * along, d.y * c + side.y * s + axis.y * along,
          d.z * c + side.z * s + axis.z * along};
}

/// Rims are blurred over a pixel; for pixels wider than twice this value the blur is limited.
constexpr double kRim = 0.03;

double smooth_step(double edge, double width, double x) { return std::clamp((x - edge) / width + 0.5, 0.0, 1.0); }

}  // namespace

std::array<float, 3> falloff(const HeadCalibration& head, double u, double v) {
  const Vignetting& vignetting = head.vignetting;
  const double x = u - vignetting.x;
  const double y = (v - vignetting.y) / head.aspect;
  const double s = (x * x + y * y) / (vignetting.radius * vignetting.radius);
  const auto& c = vignetting.coefficients;
  const double left = std::max(0.0, 1 + s * (c[0] + s * (c[1] + s * c[2])));
  return {static_cast<float>(left * head.gain[0]), static_cast<float>(left * head.gain[1]),
          static_cast<float>(left * head.gain[2])};
}

Plate expose_plate(const HeadCalibration& head, const LensTruth& lens, const Scene& scene, int supersampling) {
  Plate plate{head.width, head.height, {}};
  const auto pixels = static_cast<std::size_t>(head.width) * static_cast<std::size_t>(head.height);
  for (auto& channel : plate.light) channel.resize(pixels);
  const double step = 1.0 / supersampling;
  const auto share = static_cast<float>(step * step);
  std::size_t at = 0;
  for (int j = 0; j < head.height; ++j) {
    for (int i = 0; i < head.width; ++i, ++at) {
      const double footprint = lens.footprint(i + 0.5, j + 0.5) * step;
      Light sum;
      for (int b = 0; b < supersampling; ++b) {
        for (int a = 0; a < supersampling; ++a) {
          const auto ray = lens.ray(i + (a + 0.5) * step, j + (b + 0.5) * step);
          if (!ray) continue;
          const Light light = scene.light(*ray, footprint);
          sum.r += light.r;
          sum.g += light.g;
          sum.b += light.b;
        }
      }
      const auto left = falloff(head, i + 0.5, j + 0.5);
      plate.light[0][at] = sum.r * share * left[0];
      plate.light[1][at] = sum.g * share * left[1];
      plate.light[2][at] = sum.b * share * left[2];
    }
  }
  return plate;
}

PlacedMover::PlacedMover(const Mover& mover, Instant at)
    : shape_(mover.shape),
      axis_(mover.axis),
      radius_(mover.radius_rad),
      reach_cosine_(std::cos(mover.radius_rad + kRim)),
      reach_sine_(std::sin(mover.radius_rad + kRim)),
      colour_(mover.colour),
      stripes_(mover.stripes) {
  const std::int64_t period = mover.period.ns();
  const double phase = period == 0 ? 0 : static_cast<double>(at.ns() % period) / static_cast<double>(period);
  centre_ = turned(mover.start, mover.axis, 2 * std::numbers::pi * phase);
  if (shape_ == Mover::Shape::kBar) {
    aside_ = cross(axis_, centre_);
    const double off_axis = std::sqrt(dot(aside_, aside_));
    aside_ = {aside_.x / off_axis, aside_.y / off_axis, aside_.z / off_axis};
    ahead_ = cross(aside_, axis_);
    return;
  }
  // The stripes' poles: the up direction, made perpendicular to the line of sight.
  const Direction up{0, -1, 0};
  const double along = dot(up, centre_);
  spin_ = {up.x - along * centre_.x, up.y - along * centre_.y, up.z - along * centre_.z};
  const double length = std::sqrt(dot(spin_, spin_));
  spin_ = length > 1e-6 ? Direction{spin_.x / length, spin_.y / length, spin_.z / length} : Direction{1, 0, 0};
  side_ = cross(centre_, spin_);
}

double PlacedMover::inside_bar(const Direction& from) const {
  const double ahead = dot(from, ahead_);
  const double aside = dot(from, aside_);
  const double beyond = std::abs(std::atan2(aside, ahead)) - radius_;
  // Beyond a quarter turn, the nearest point of the edge is its pole.
  const double off_axis = std::sqrt(ahead * ahead + aside * aside);
  return -std::asin(
      std::min(1.0, off_axis * std::sin(std::clamp(beyond, -std::numbers::pi / 2, std::numbers::pi / 2))));
}

bool PlacedMover::may_touch(const Direction& middle, double cap_cosine, double cap_sine) const {
  if (shape_ == Mover::Shape::kBar) return inside_bar(middle) > -(std::atan2(cap_sine, cap_cosine) + kRim);
  // cos(cap + reach); both angles are small enough for their sum to stay below pi.
  return dot(middle, centre_) > cap_cosine * reach_cosine_ - cap_sine * reach_sine_;
}

PlacedMover::Cover PlacedMover::cover(const Direction& from, double footprint_rad) const {
  if (shape_ == Mover::Shape::kBar) {
    return {static_cast<float>(smooth_step(0, footprint_rad, inside_bar(from))), colour_};
  }
  const double cosine = dot(from, centre_);
  if (cosine < reach_cosine_) return {};
  const Direction off{from.x - cosine * centre_.x, from.y - cosine * centre_.y, from.z - cosine * centre_.z};
  const double angle = std::asin(std::min(1.0, std::sqrt(dot(off, off))));
  const double share = 1 - smooth_step(radius_, footprint_rad, angle);
  if (share <= 0) return {};
  // A point on the visible face of the ball: right and up within the unit disc.
  const double up = dot(off, spin_) / radius_;
  const double right = dot(off, side_) / radius_;
  const double depth = std::sqrt(std::max(0.0, 1 - up * up - right * right));
  const double meridian = std::atan2(right, depth + 1e-9);
  const double wave = std::sin(8 * meridian);
  const double sharpness = std::clamp(radius_ / (8 * footprint_rad), 1.0, 40.0);
  const double stripe = std::clamp(wave * sharpness + 0.5, 0.0, 1.0);
  const double lit = 0.45 + 0.55 * std::max(0.0, 0.6 * up + 0.35 * right + 0.6 * depth);
  const auto mix = [&](float a, float b) { return static_cast<float>((a * stripe + b * (1 - stripe)) * lit); };
  return {static_cast<float>(share),
          {mix(colour_.r, stripes_.r), mix(colour_.g, stripes_.g), mix(colour_.b, stripes_.b)}};
}

}  // namespace nodal::hal::sim
