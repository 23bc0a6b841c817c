// Whether a rig still stands as it was calibrated, by what its heads see of each other now.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "stitch/registration/registration.h"

namespace nodal::registration {

enum class Standing : std::uint8_t {
  kStands,   ///< within the tolerance, and known well enough to say so
  kMoved,    ///< farther than the tolerance, and not by chance
  kUnknown,  ///< the frames do not say
};
std::string_view standing_name(Standing standing);

struct HeadDrift {
  std::string name;
  Standing standing = Standing::kUnknown;
  std::string why;       ///< one sentence, when it is unknown
  double moved_deg = 0;  ///< from where the calibration has it, against what most heads agree on
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

/// Registers the rotations anew and compares. Which heads moved is told by what most of them agree on: of two heads that
/// moved apart nobody can say which it was, and each is given half.
///
/// Threading, Ownership, Errors: as register_heads().
Result<DriftReport> measure_drift(const Calibration& calibration, const std::vector<FrameSet>& frame_sets,
                                  const DriftOptions& options);

/// What calibrations leave of the differences on the same frames: the objective on the finest raymap, each with the gains
/// that suit it best, since exposures may be others than when it was made. Lower is better.
///
/// Threading, Ownership: as register_heads().
/// Errors: kBadValue for frames that do not fit; kNoCoverage when heads share nothing; kNotDetermined for black ones.
Result<std::vector<double>> objectives_of(const std::vector<Calibration>& calibrations,
                                          const std::vector<FrameSet>& frame_sets, const Options& options);

}  // namespace nodal::registration
