// Measures from current overlaps whether a rig's heads still have the orientations of its calibration.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "stitch/registration/registration.h"

namespace nodal::registration {

enum class Standing : std::uint8_t {
  kStands,   ///< within the tolerance, and the measurement is accurate enough
  kMoved,    ///< outside the tolerance by more than the measurement's uncertainty
  kUnknown,  ///< the frames do not determine it
};
std::string_view standing_name(Standing standing);

struct HeadDrift {
  std::string name;
  Standing standing = Standing::kUnknown;
  std::string why;       ///< one sentence, if it is unknown
  double moved_deg = 0;  ///< from the calibration's orientation, relative to the consensus of most heads
  double sigma_deg = 0;  ///< standard deviation about the worst axis; infinite if the frames do not determine it
  double moved_px = 0;   ///< the same in pixels on the lens's axis
  double sigma_px = 0;
  /// The components about the head's own axes: up and to the right in the picture, and clockwise as the head sees it.
  double up_deg = 0, right_deg = 0, roll_deg = 0;
};

struct DriftReport {
  std::vector<HeadDrift> heads;
  double objective_before = 0, objective_after = 0;  ///< as Report's
  Calibration calibration;                           ///< with the heads' current rotations
  std::vector<std::string> warnings;

  bool any(Standing standing) const;
};

struct DriftOptions {
  double tolerance_px = 0.5;  ///< half a pixel becomes visible at seams
  int threads = 0;
  std::function<void(const Step&, double)> progress;
};

/// Registers the rotations again and compares them. The consensus of most heads determines which head moved. If only
/// two heads moved relative to each other, the frames cannot tell which one did, and each gets half of the movement.
///
/// Threading, Ownership, Errors: as register_heads().
Result<DriftReport> measure_drift(const Calibration& calibration, const std::vector<FrameSet>& frame_sets,
                                  const DriftOptions& options);

/// The remaining differences with each calibration on the same frames: the objective on the finest raymap. Gains are
/// fitted for each calibration, because exposures may have changed since it was made. Lower is better.
///
/// Threading, Ownership: as register_heads().
/// Errors: kBadValue for frames that do not fit the calibration; kNoCoverage if no heads overlap; kNotDetermined if a
/// head is black.
Result<std::vector<double>> objectives_of(const std::vector<Calibration>& calibrations,
                                          const std::vector<FrameSet>& frame_sets, const Options& options);

}  // namespace nodal::registration
