#include "stitch/table/tabled_lens.h"

namespace nodal::table {
namespace {

constexpr int kPieces = 1024;
constexpr double kWidest = 3.1;  // rad, largest angle in the table: the tangent of pi / 2 is infinite

}  // namespace

TabledLens::Piece TabledLens::hermite(double at0, double at1, double slope0, double slope1) {
  const double rise = at1 - at0;
  return {at0, slope0, 3 * rise - 2 * slope0 - slope1, slope0 + slope1 - 2 * rise, false};
}

TabledLens::TabledLens(const geometry::Lens& lens, double reach)
    : lens_(lens),
      max_angle_(reach),
      max_half_(std::tan(std::min(reach, kWidest) / 2)),
      max_radius_(lens.radius(reach).value_or(lens.max_radius())) {
  const double dh = max_half_ / kPieces;
  const double dr = max_radius_ / kPieces;
  pieces_per_half_ = 1 / dh;
  pieces_per_px_ = 1 / dr;
  const auto at_half = [&](double k) { return std::min(2 * std::atan(k * dh), max_angle_); };
  const auto radius_at = [&](double k) { return lens.radius(at_half(k)).value_or(0); };
  const auto angle_at = [&](double k) { return lens.angle(std::min(k * dr, max_radius_)).value_or(0); };
  double r0 = 0, r0_slope = lens.slope(0, 0) * 2 * dh;
  double a0 = 0, a0_slope = dr / lens.slope(0, 0);
  for (int k = 0; k < kPieces; ++k) {
    const double r1 = radius_at(k + 1);
    const double r1_half = (k + 1) * dh;
    const double r1_slope = lens.slope(at_half(k + 1), r1) * 2 * dh / (1 + r1_half * r1_half);
    Piece radius = hermite(r0, r1, r0_slope, r1_slope);
    // A quarter of kTolerance: the slope's error is the position's error divided by the width of a piece.
    radius.exact = !(std::abs(value_at(radius, 0.5) - radius_at(k + 0.5)) < kTolerance / 4);
    radius_.push_back(radius);
    r0 = r1;
    r0_slope = r1_slope;

    const double a1 = angle_at(k + 1);
    const double a1_slope = dr / lens.slope(a1, std::min((k + 1) * dr, max_radius_));
    Piece angle = hermite(a0, a1, a0_slope, a1_slope);
    angle.exact = !(std::abs(value_at(angle, 0.5) - angle_at(k + 0.5)) * max_radius_ < kTolerance);
    angle_.push_back(angle);
    a0 = a1;
    a0_slope = a1_slope;
  }
}

std::optional<TabledLens::Radius> TabledLens::exact_radius(double angle) const {
  if (!(angle <= max_angle_)) return std::nullopt;
  const std::optional<double> radius = lens_.radius(angle);
  if (!radius) return std::nullopt;
  return Radius{*radius, lens_.slope(angle, *radius)};
}

std::optional<double> TabledLens::angle(double radius) const {
  if (!(radius >= 0 && radius <= max_radius_)) return std::nullopt;
  const double at = radius * pieces_per_px_;
  const auto k = std::min(static_cast<std::size_t>(at), angle_.size() - 1);
  if (angle_[k].exact) return lens_.angle(radius);
  return value_at(angle_[k], at - static_cast<double>(k));
}

}  // namespace nodal::table
