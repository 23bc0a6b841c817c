// The difference of two calibrations of one rig: per head, in degrees, pixels and stops.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::calibration {

struct HeadDifference {
  std::string name;        ///< its name in the first calibration
  std::string other;       ///< its name in the second
  double raw_deg = 0;      ///< the rotation between the two orientations of the head
  double turned_deg = 0;   ///< the same after the rotation of the whole rig that minimizes the differences
  double lens_rms_px = 0;  ///< lens and centre only: distance between the two pixels of a ray of the head
  double lens_max_px = 0;
  double rms_px = 0;  ///< with orientation, after the rig's rotation: distance between the two pixels of a rig's ray
  double max_px = 0;
  std::array<double, 3> gain_stops{};  ///< red, green, blue, without the part common to all heads
  double vignetting_stops = 0;         ///< largest difference over the region
  double response_levels = 0;          ///< largest difference of light for one encoded value, in 1/255
};

struct RigDifference {
  std::vector<HeadDifference> heads;
  double rig_turn_deg = 0;         ///< the rotation of the whole rig that was removed
  double turned_rms_deg = 0;       ///< rms over the heads
  std::vector<std::string> notes;  ///< heads in only one of them, pictures of different sizes
};

/// Heads are paired by name; if no name is in both and the counts are equal, by index.
/// Errors: those of check_calibration; kHeadMismatch if no heads can be paired.
Result<RigDifference> difference_of(const Calibration& a, const Calibration& b);

}  // namespace nodal::calibration
