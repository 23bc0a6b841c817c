#include "stitch/table/tabled_lens.h"

#include <algorithm>
#include <cmath>

namespace nodal::table {
namespace {

constexpr int kPieces = 1024;

template <class P>
double value_at(const P& piece, double t) {
  return piece.c0 + t * (piece.c1 + t * (piece.c2 + t * piece.c3));
}

}  // namespace

TabledLens::Piece TabledLens::hermite(double at0, double at1, double slope0, double slope1) {
  const double rise = at1 - at0;
  return {at0, slope0, 3 * rise - 2 * slope0 - slope1, slope0 + slope1 - 2 * rise, false};
}

TabledLens::TabledLens(const geometry::Lens& lens, double reach)
    : lens_(lens), max_angle_(reach), max_radius_(lens.radius(reach).value_or(lens.max_radius())) {
  const double da = max_angle_ / kPieces;
  const double dr = max_radius_ / kPieces;
  pieces_per_radian_ = 1 / da;
  pieces_per_px_ = 1 / dr;
  const auto radius_at = [&](double k) { return lens.radius(std::min(k * da, max_angle_)).value_or(0); };
  const auto angle_at = [&](double k) { return lens.angle(std::min(k * dr, max_radius_)).value_or(0); };
  for (int k = 0; k < kPieces; ++k) {
    const double r0 = radius_at(k);
    const double r1 = radius_at(k + 1);
    Piece radius = hermite(r0, r1, lens.slope(k * da, r0) * da, lens.slope((k + 1) * da, r1) * da);
    radius.exact = !(std::abs(value_at(radius, 0.5) - radius_at(k + 0.5)) < kTolerance);
    radius_.push_back(radius);

    const double a0 = angle_at(k);
    const double a1 = angle_at(k + 1);
    Piece angle = hermite(a0, a1, dr / lens.slope(a0, k * dr), dr / lens.slope(a1, (k + 1) * dr));
    angle.exact = !(std::abs(value_at(angle, 0.5) - angle_at(k + 0.5)) * max_radius_ < kTolerance);
    angle_.push_back(angle);
  }
}

std::optional<TabledLens::Radius> TabledLens::radius(double angle) const {
  if (!(angle >= 0 && angle <= max_angle_)) return std::nullopt;
  const double at = angle * pieces_per_radian_;
  const auto k = std::min(static_cast<std::size_t>(at), radius_.size() - 1);
  const Piece& piece = radius_[k];
  if (piece.exact) {
    const std::optional<double> radius = lens_.radius(angle);
    if (!radius) return std::nullopt;
    return Radius{*radius, lens_.slope(angle, *radius)};
  }
  const double t = at - static_cast<double>(k);
  return Radius{value_at(piece, t), (piece.c1 + t * (2 * piece.c2 + 3 * t * piece.c3)) * pieces_per_radian_};
}

std::optional<double> TabledLens::angle(double radius) const {
  if (!(radius >= 0 && radius <= max_radius_)) return std::nullopt;
  const double at = radius * pieces_per_px_;
  const auto k = std::min(static_cast<std::size_t>(at), angle_.size() - 1);
  if (angle_[k].exact) return lens_.angle(radius);
  return value_at(angle_[k], at - static_cast<double>(k));
}

}  // namespace nodal::table
