// A head's lens of any model: angle from the axis to radius in the picture, and back.
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

/// Radial, rising from 0 at the axis to max_radius at max_angle. Angles in rad from the axis (above pi/2: behind the
/// head); radii in px from the lens's centre, with the aspect divided out. A value: copy it freely.
///
/// Threading: immutable.
class Lens {
 public:
  /// `max_angle` limits the lens; 0: up to the end of the model's rising part.
  /// Errors: kBadValue for invalid numbers, kLensDomain for a max_angle beyond the turning point.
  static Result<Lens> make(const LensModel& model, double max_angle = 0);

  double max_angle() const { return max_angle_; }
  double max_radius() const { return max_radius_; }

  /// Nothing beyond max_angle (by more than rounding: a relative 1e-12).
  std::optional<double> radius(double angle) const;
  /// Nothing beyond max_radius, with the same tolerance.
  std::optional<double> angle(double radius) const;
  /// dr/da in px per radian at an angle within max_angle.
  double slope(double angle) const;
  /// The same if radius(angle) is already known; saves computing an inverse.
  double slope(double angle, double radius) const;

 private:
  using Model = std::variant<Tsai, Rectilinear, Equidistant, KannalaBrandt>;
  explicit Lens(Model model) : model_(std::move(model)) {}
  Model model_;
  double max_angle_ = 0;
  double max_radius_ = 0;
};

}  // namespace nodal::geometry
