// A head's lens as tables of cubics, for the compiler's millions of evaluations.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "stitch/geometry/lens/lens.h"

namespace nodal::table {

/// radius(direction) and angle(radius) of a lens, up to `reach` from its axis, by cubic Hermite pieces. Their error is
/// at most kTolerance px for the radius and kTolerance / largest radius (rad) for the angle. Pieces that would exceed
/// it (at a turning point the slope is infinite) evaluate the lens itself. Blend tables have a resolution of 1/4096 px.
/// Radii are indexed by the tangent of half the angle, which takes one division; the angle itself would take an arc
/// tangent.
///
/// Threading: immutable.
class TabledLens {
 public:
  static constexpr double kTolerance = 1e-6;

  /// reach: rad, > 0, at most the lens's max_angle.
  TabledLens(const geometry::Lens& lens, double reach);

  struct Radius {
    double radius = 0;  ///< px, before the aspect is applied
    double slope = 0;   ///< px per radian
  };
  /// The radius at an angle from the axis with this sine (>= 0) and cosine; nothing beyond the reach.
  std::optional<Radius> radius(double sine, double cosine) const {
    const double half = sine / (1 + cosine);
    if (!(half <= max_half_)) return exact_radius(std::atan2(sine, cosine));
    const double at = half * pieces_per_half_;
    const auto k = std::min(static_cast<std::size_t>(at), radius_.size() - 1);
    const Piece& piece = radius_[k];
    if (piece.exact) return exact_radius(std::atan2(sine, cosine));
    const double t = at - static_cast<double>(k);
    const double slope = piece.c1 + t * (2 * piece.c2 + 3 * t * piece.c3);
    return Radius{value_at(piece, t), slope * pieces_per_half_ * 0.5 * (1 + half * half)};
  }
  /// Whether radius() evaluates the lens itself there, which takes long.
  bool is_exact(double sine, double cosine) const {
    const double half = sine / (1 + cosine);
    if (!(half <= max_half_)) return true;
    return radius_[std::min(static_cast<std::size_t>(half * pieces_per_half_), radius_.size() - 1)].exact;
  }
  /// Nothing beyond the radius that belongs to the reach.
  std::optional<double> angle(double radius) const;

 private:
  struct Piece {
    double c0 = 0, c1 = 0, c2 = 0, c3 = 0;  ///< c0 + t (c1 + t (c2 + t c3)), t in 0..1 over the piece
    bool exact = true;
  };
  static double value_at(const Piece& piece, double t) {
    return piece.c0 + t * (piece.c1 + t * (piece.c2 + t * piece.c3));
  }
  std::optional<Radius> exact_radius(double angle) const;
  static Piece hermite(double at0, double at1, double slope0, double slope1);

  geometry::Lens lens_;
  double max_angle_ = 0;
  double max_half_ = 0;  ///< tangent of half the reach
  double max_radius_ = 0;
  double pieces_per_half_ = 0;
  double pieces_per_px_ = 0;
  std::vector<Piece> radius_;
  std::vector<Piece> angle_;
};

}  // namespace nodal::table
