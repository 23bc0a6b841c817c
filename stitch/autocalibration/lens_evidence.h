// What matches say about the lens that heads share.
#pragma once

#include <string_view>

namespace nodal::autocalibration {

/// What matches say about the shared lens. Radii in units.
struct LensEvidence {
  std::string_view family;              ///< the family that the lens follows where there are no matches; empty: none
  double seen_from = 0, seen_to = 1;    ///< radii at which there are matches
  double known_from = 0, known_to = 1;  ///< radii at which the lens is known to 2 %
  double unsure = 0;                    ///< two standard deviations at the worst radius, as a share of that radius

  bool nowhere() const { return known_to <= known_from; }
  /// Whether the lens is known over most of the radius, so that estimates of a head's lens are not extrapolated.
  bool mostly() const { return known_to - known_from >= 0.7; }
  bool whole() const { return known_from <= 0 && known_to >= 1; }
};

}  // namespace nodal::autocalibration
