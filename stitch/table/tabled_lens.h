// A head's lens as tables of cubics: what the compiler asks a lens millions of times, it asks these.
#pragma once

#include <optional>
#include <vector>

#include "stitch/geometry/lens.h"

namespace nodal::table {

/// radius(angle) and angle(radius) of a lens, up to `reach` from its axis, by cubic Hermite pieces that are true to
/// the lens to kTolerance px and to kTolerance / the largest radius in rad. Pieces that would not be (at a turning
/// point the slope has no end) ask the lens itself. The table's places are in 1/4096 px.
///
/// Threading: immutable.
class TabledLens {
 public:
  static constexpr double kTolerance = 1e-6;

  /// reach, rad: at most the lens's max_angle, more than 0.
  TabledLens(const geometry::Lens& lens, double reach);

  struct Radius {
    double radius = 0;  ///< px, the aspect taken out
    double slope = 0;   ///< px per radian
  };
  /// Nothing beyond the reach.
  std::optional<Radius> radius(double angle) const;
  /// Nothing beyond the radius of the reach.
  std::optional<double> angle(double radius) const;

 private:
  struct Piece {
    double c0 = 0, c1 = 0, c2 = 0, c3 = 0;  ///< c0 + t (c1 + t (c2 + t c3)), t in 0..1 over the piece
    bool exact = true;
  };
  static Piece hermite(double at0, double at1, double slope0, double slope1);

  geometry::Lens lens_;
  double max_angle_ = 0;
  double max_radius_ = 0;
  double pieces_per_radian_ = 0;
  double pieces_per_px_ = 0;
  std::vector<Piece> radius_;
  std::vector<Piece> angle_;
};

}  // namespace nodal::table
