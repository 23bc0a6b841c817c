// The simulator's own lens model: the ray of a point in the original picture. It shares no code with stitch/geometry,
// so that each can verify the other.
#pragma once

#include <optional>
#include <vector>

#include "hal/sim/scene/scene.h"
#include "protocol/calibration.h"

namespace nodal::hal::sim {

/// Converts every model once to a table over the radius, by bracketing and bisection of the model's formula: accurate
/// to 1e-7 rad for any lens of a valid calibration.
///
/// Threading: thread-safe; immutable.
/// Ownership: none.
/// Errors: none; a point that receives no light has no ray.
class LensTruth {
 public:
  explicit LensTruth(const HeadCalibration& head);

  /// The ray, in the rig frame, of the point (u, v), with corners at integers; nothing beyond the lens's domain, its
  /// max_angle or the head's region.
  std::optional<Direction> ray(double u, double v) const;
  /// The angle in rad of a pixel at (u, v): the square root of its solid angle; 0 where ray() is nothing.
  double footprint(double u, double v) const;

 private:
  struct Entry {
    double sine_by_radius = 0;  ///< sin(angle) / r, so that a pixel needs no trigonometry
    double cosine = 1;
    double angle = 0;
  };

  double radius_of(double u, double v) const;

  double center_x_, center_y_, aspect_;
  std::array<double, 9> R_head_rig_;
  Region region_;
  double step_ = 1;        ///< px between entries
  double radius_end_ = 0;  ///< beyond it there is no light
  std::vector<Entry> table_;
};

/// The angle for each radius i * step, i from 0; ends at the lens's limit.
std::vector<double> angles_by_radius(const LensModel& lens, double step, int count);

}  // namespace nodal::hal::sim
