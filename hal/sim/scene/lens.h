// The simulator's own lens maths: which ray a point of the original picture collects. Shares nothing with
// stitch/geometry, so that one can prove the other.
#pragma once

#include <optional>
#include <vector>

#include "hal/sim/scene/scene.h"
#include "protocol/calibration.h"

namespace nodal::hal::sim {

/// Every model is turned once into a table over the radius, by bracketing and bisection of the model's formula:
/// to 1e-7 rad for any lens that a calibration may hold.
///
/// Threading: thread-safe; immutable.
/// Ownership: none.
/// Errors: none; a point without light has no ray.
class LensTruth {
 public:
  explicit LensTruth(const HeadCalibration& head);

  /// The ray in the rig frame of the point (u, v), corners at integers; nothing beyond the lens's domain, its
  /// max_angle or the head's region.
  std::optional<Direction> ray(double u, double v) const;
  /// Radians that a pixel at (u, v) spans, by its area; 0 where ray() is nothing.
  double footprint(double u, double v) const;

 private:
  struct Entry {
    double sine_by_radius = 0;  ///< sin(angle) / r, so that no trigonometry is left for a pixel
    double cosine = 1;
    double angle = 0;
  };

  double radius_of(double u, double v) const;

  double center_x_, center_y_, aspect_;
  std::array<double, 9> R_head_rig_;
  Region region_;
  double step_ = 1;        ///< px between entries
  double radius_end_ = 0;  ///< no light beyond
  std::vector<Entry> table_;
};

/// The angle of each radius i * step, i from 0; ends where the lens does.
std::vector<double> angles_by_radius(const LensModel& lens, double step, int count);

}  // namespace nodal::hal::sim
