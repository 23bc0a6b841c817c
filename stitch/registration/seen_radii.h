// How much of the lenses' radius the overlaps of a rig show.
#pragma once

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::registration {

struct SeenRadii {
  /// Share of the radius, from the axis to the edge of what is used; of lenses beyond 90 degrees, of the angle if that
  /// is less. 0: no overlaps.
  double span = 0;
  double from_deg = 0, to_deg = 0;  ///< angles of the seen rays from the lenses' axes

  /// Whether overlaps that show so little determine whole lenses. Fisheyes of 220 degrees back to back show 0.36 of it,
  /// and any lens that is odd about 90 degrees fits them; a ring of heads that share a quarter shows 0.6.
  bool determine_lenses() const;
};

/// With the calibration's rotations and lenses, of all heads together.
/// Errors: those of geometry::make_heads().
Result<SeenRadii> seen_radii(const Calibration& calibration);

}  // namespace nodal::registration
