// The difference of two calibrations of one rig: per head, in degrees, pixels and stops.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::calibration {

struct HeadDifference {
  std::string name;        ///< in the first calibration
  std::string other;       ///< in the second
  double raw_deg = 0;      ///< the rotation between the two orientations of the head
  double turned_deg = 0;   ///< the same after the rotation of the whole rig that minimizes the differences
  double lens_rms_px = 0;  ///< of lens and centre alone: distance between the two pixels of a ray of the head
  double lens_max_px = 0;
  double rms_px = 0;  ///< with orientation, after the rig's rotation: distance of the pixels of a ray of the rig
  double max_px = 0;
  std::array<double, 3> gain_stops{};  ///< red, green, blue, without the part that all heads share
  double vignetting_stops = 0;         ///< largest, over the region
  double response_levels = 0;          ///< largest difference of light at one value, of 255
};

struct RigDifference {
  std::vector<HeadDifference> heads;
  double rig_turn_deg = 0;         ///< the turn of the whole rig that was taken out
  double turned_rms_deg = 0;       ///< over the heads
  std::vector<std::string> notes;  ///< heads that only one has, pictures of two sizes
};

/// Heads are paired by name; when no name is in both and the counts are equal, by their order.
/// Errors: those of check_calibration; kHeadMismatch when nothing can be paired.
Result<RigDifference> difference_of(const Calibration& a, const Calibration& b);

}  // namespace nodal::calibration
