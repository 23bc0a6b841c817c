// How far a lens model can be trusted: up to the angle where its radius stops growing. Beyond that turning
// point two angles share a pixel. Arithmetic only, so that a document is checked without the geometry library.
#pragma once

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal {

/// A pinhole's picture of 90 degrees lies at infinity, so Tsai and rectilinear lenses end at 89.99 degrees.
inline constexpr double kMaxPinholeAngle = 1.5706217938696971;

/// The range in which the radius rises with the angle: angles 0..max_angle (rad) map to radii 0..max_radius (px, the
/// aspect taken out). Both are 0 when it does not rise at all.
struct LensRange {
  double max_angle = 0;
  double max_radius = 0;
  bool turns = false;  ///< ends at a turning point, not at what the kind of lens can see
};
LensRange lens_range(const LensModel& lens);

/// Whether the numbers make a lens, and one that rises up to max_angle (rad; 0: as far as it goes).
/// Errors: kBadValue, or kLensDomain, which says where the lens turns.
Status check_lens(const LensModel& lens, double max_angle);

/// The radius at `angle` (0..lens_range().max_angle), px.
double lens_radius(const LensModel& lens, double angle);

/// The largest lens radius (from x, y; aspect taken out) that a point of the region has.
double farthest_radius(const Region& region, double x, double y, double aspect);

/// The model's name in documents: "tsai", "rectilinear", "equidistant", "kannala_brandt".
const char* lens_model_name(const LensModel& lens);

}  // namespace nodal
