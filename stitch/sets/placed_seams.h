// When placed seams are placed, and from which set on they are in force: the same on a rig and on a host.
#pragma once

#include <cstdint>
#include <string>

#include "stitch/sets/installed_calibration.h"

namespace nodal::sets {

/// Seams are placed by the first set that is blended of every kSeamPeriod numbers, and are in force from the next such
/// period on. So they do not depend on how long placing takes, as long as that is less than a period.
inline constexpr std::uint64_t kSeamPeriod = 8;
inline std::uint64_t seam_period(std::uint64_t set) { return set / kSeamPeriod; }

struct PlacedSeams {
  InstalledPtr installed;  ///< the calibration in force, with other seams; null: they stay where they are
  std::string refused;     ///< why tables with other seams were not proven, so that the old ones stay; empty: they were
};
/// Places the seams for the set whose views are in the `seam_pictures` of the calibration in force, one with SeamViews. They stay, too,
/// where there is no memory for other ones.
PlacedSeams place_seams(const InstalledCalibration& in_force);

}  // namespace nodal::sets
