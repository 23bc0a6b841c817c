// How much of the sphere the heads of a rig see, and where.
#pragma once

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/raymap/registry.h"

namespace nodal::host {

/// A smaller share is a panorama rather than a sphere.
inline constexpr double kMinSphereShare = 0.6;

/// Columns and rows of an equirectangular raymap.
struct RaymapPart {
  int left = 0, top = 0, width = 0, height = 0;
};

struct SeenPart {
  double share = 0;  ///< share of the solid angle of the sphere
  /// The smallest part that holds all pixels that a head sees; `left + width` may be over the right edge.
  RaymapPart part;
};

/// `size`: of the equirectangular raymap. Small gaps between what heads see may be taken for seen.
/// Errors: those of geometry::make_heads().
Result<SeenPart> seen_part(const Calibration& calibration, geometry::RaymapSize size);

/// Turns a rig that sees less than kMinSphereShare about the vertical axis, so that the middle of what it sees is at
/// yaw 0. Errors: those of seen_part().
Status turn_to_middle(Calibration& calibration);

}  // namespace nodal::host
