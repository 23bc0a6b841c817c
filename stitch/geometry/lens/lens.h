// A head's lens, whatever its model: angle from the axis to radius on the picture, and back.
#pragma once

#include <optional>
#include <variant>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/lens/equidistant.h"
#include "stitch/geometry/lens/kannala_brandt.h"
#include "stitch/geometry/lens/rectilinear.h"
#include "stitch/geometry/lens/tsai.h"

namespace nodal::geometry {

/// Radial, rising from 0 at the axis to max_radius at max_angle. Angles in rad from the axis (more than pi/2
/// is behind the head); radii in px from the lens's centre, the aspect taken out. A value: copy it freely.
///
/// Threading: immutable.
class Lens {
 public:
  /// `max_angle` caps the lens; 0 takes it as far as its model rises.
  /// Errors: kBadValue for numbers that make no lens, kLensDomain for a max_angle past the turning point.
  static Result<Lens> make(const LensModel& model, double max_angle = 0);

  double max_angle() const { return max_angle_; }
  double max_radius() const { return max_radius_; }

  /// Nothing beyond max_angle (by more than rounding: 1e-12 of it).
  std::optional<double> radius(double angle) const;
  /// Nothing beyond max_radius, in the same way.
  std::optional<double> angle(double radius) const;
  /// dr/da in px per radian at an angle within max_angle.
  double slope(double angle) const;
  /// The same where radius(angle) is already known; spares an inverse.
  double slope(double angle, double radius) const;

 private:
  using Model = std::variant<Tsai, Rectilinear, Equidistant, KannalaBrandt>;
  explicit Lens(Model model) : model_(std::move(model)) {}
  Model model_;
  double max_angle_ = 0;
  double max_radius_ = 0;
};

}  // namespace nodal::geometry
