// Whether a rig's heads still have the orientations of its calibration, from their overlaps now.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "stitch/registration/registration.h"

namespace nodal::registration {

enum class Standing : std::uint8_t {
  kStands,   ///< within the tolerance, and known well enough to say so
  kMoved,    ///< beyond the tolerance by more than the measurement's uncertainty
  kUnknown,  ///< the frames do not determine it
};
std::string_view standing_name(Standing standing);

struct HeadDrift {
  std::string name;
  Standing standing = Standing::kUnknown;
  std::string why;       ///< one sentence, when it is unknown
  double moved_deg = 0;  ///< from the calibration's orientation, relative to the consensus of most heads
  double sigma_deg = 0;  ///< standard deviation about the worst axis; infinite when the frames say nothing
  double moved_px = 0;   ///< the same in pixels on the lens's axis
  double sigma_px = 0;
  /// The parts about the head's own axes: up on the picture, to its right, clockwise as the head sees the scene.
  double up_deg = 0, right_deg = 0, roll_deg = 0;
};

struct DriftReport {
  std::vector<HeadDrift> heads;
  double objective_before = 0, objective_after = 0;  ///< as Report's
  Calibration calibration;                           ///< as the heads stand now
  std::vector<std::string> warnings;

  bool any(Standing standing) const;
};

struct DriftOptions {
  double tolerance_px = 0.5;  ///< half a pixel begins to show at seams
  int threads = 0;
  std::function<void(const Step&, double)> progress;
};

/// Registers the rotations anew and compares. The consensus of most heads decides which of them moved: when two heads
/// moved apart it is unknown which did, and each gets half of it.
///
/// Threading, Ownership, Errors: as register_heads().
Result<DriftReport> measure_drift(const Calibration& calibration, const std::vector<FrameSet>& frame_sets,
                                  const DriftOptions& options);

/// The residual differences of calibrations on the same frames: the objective on the finest raymap, each with its best
/// gains, since exposures may differ from those when it was made. Lower is better.
///
/// Threading, Ownership: as register_heads().
/// Errors: kBadValue for frames that do not fit; kNoCoverage when heads share nothing; kNotDetermined for black ones.
Result<std::vector<double>> objectives_of(const std::vector<Calibration>& calibrations,
                                          const std::vector<FrameSet>& frame_sets, const Options& options);

}  // namespace nodal::registration
