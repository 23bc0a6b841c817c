// The valid range of a lens model: up to the angle where its radius stops growing. Beyond that turning point two angles
// share a pixel. Independent of the geometry library, so that documents can be checked without it.
#pragma once

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal {

/// At 90 degrees a pinhole's radius is infinite, so Tsai and rectilinear lenses end at 89.99 degrees.
inline constexpr double kMaxPinholeAngle = 1.5706217938696971;

/// The range in which the radius rises with the angle: angles 0..max_angle (rad) map to radii 0..max_radius (px, aspect
/// divided out). Both are 0 if it does not rise at all.
struct LensRange {
  double max_angle = 0;
  double max_radius = 0;
  bool turns = false;  ///< whether the range ends at a turning point, and not at the limit of the lens kind
};
LensRange lens_range(const LensModel& lens);

/// Checks that the numbers are a valid lens that rises up to max_angle (rad; 0: up to its end).
/// Errors: kBadValue, or kLensDomain, which states where the lens turns.
Status check_lens(const LensModel& lens, double max_angle);

/// The radius at `angle` (0..lens_range().max_angle), px.
double lens_radius(const LensModel& lens, double angle);

/// The largest radius, measured from (x, y) with the aspect divided out, of a point of the region.
double farthest_radius(const Region& region, double x, double y, double aspect);

}  // namespace nodal
