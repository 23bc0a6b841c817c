// Registration (§4.2, §4.4): finds how the heads of a rig stand to each other, and what their lenses and their light
// do, by making the rays they share look alike.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::registration {

/// The frames that one trigger exposed: one picture a head, in the calibration's order. Not kMjpeg.
using FrameSet = std::vector<ImageView>;

/// What is sought beside gain and vignetting; each holds what stands before it.
enum class Free : std::uint8_t {
  kRotations,
  kFocals,  ///< one scale a head
  kLens,    ///< centre and radial coefficients a head too
};
/// How the heads' differences on one ray count (§4.2): all of them, or only the worst one.
enum class Norm : std::uint8_t { kSum, kMax };
/// What is compared: luminance, or red, green and blue each with its own gain.
enum class Colour : std::uint8_t { kLuminance, kRgb };
/// Fall-off stays as the prior has it where all heads share only their rims.
enum class VignettingModel : std::uint8_t {
  kFixed,   ///< as the prior has it
  kShared,  ///< the same fall-off for every head, about its own lens centre
  kOwn,     ///< a head that shares only its rim, which tells no fall-off, has the mean of those that share more
};
/// What holds the rig as a whole, which no overlap says anything about.
enum class Gauge : std::uint8_t {
  kFirstHead,  ///< the first head that is placed stays where the prior has it
  kMean,       ///< the heads' turns have mean zero
  kMost,       ///< the heads' turns have geometric median zero: those that moved do not turn those that did not
};

/// One evaluation of the objective that was accepted.
struct Step {
  int width = 0;          ///< of the raymap it was summed on, px
  int level = 0;          ///< of the pictures' pyramid; 0 is full size, each next one half
  int iteration = 0;      ///< 0 is where the level starts
  double objective = 0;   ///< mean squared difference of the shared rays, 8-bit levels squared
  double turned_deg = 0;  ///< the largest turn of a head in this step
};

struct Options {
  Free free = Free::kRotations;
  /// False: heads stay where they are with their lenses, whatever `free` says; gains and fall-off alone are sought.
  bool geometry = true;
  Norm norm = Norm::kSum;
  Colour colour = Colour::kLuminance;
  bool gains = true;
  VignettingModel vignetting = VignettingModel::kOwn;
  Gauge gauge = Gauge::kFirstHead;
  /// The raymap that the objective is summed on; its result depends on it (§4.2).
  std::string layout = "equirectangular";
  /// The finest raymap has as many rays as an equirectangular one this wide; 0: as fine as the pictures are.
  int width = 0;
  /// With Free::kLens: the prior's lenses are only of the right kind. They are sought from the coarsest level on, at
  /// first one for all heads.
  bool lens_far_off = false;
  /// Looks for heads that stand far from the prior, before the descent.
  bool search = true;
  int threads = 0;  ///< 0: one a core. The result does not depend on it.
  /// Called on the caller's thread after every accepted step, with what share of the work is done (0..1).
  std::function<void(const Step&, double)> progress;
};

struct HeadReport {
  std::string name;
  bool placed = true;     ///< false: the frames do not say where it is, and it stands as the prior has it
  std::string why_not;    ///< one sentence, when it is not placed
  double turned_deg = 0;  ///< from the prior
  double sigma_deg = 0;   ///< standard deviation of its rotation about its worst axis; of an unplaced head what
                          ///< the frames alone would give, infinite when they say nothing
  double focal_change_percent = 0;
  double sigma_focal_percent = 0;  ///< 0 when not sought
  double shared_sr = 0;            ///< of its view, seen by others too
};

/// What two heads say of the rays they share.
struct PairReport {
  int a = 0, b = 0;  ///< indices of heads, a < b
  double shared_sr = 0;
  double rms_before = 0;  ///< rms difference in 8-bit levels, with the prior
  double rms_after = 0;
  double agreement = 0;  ///< of the detail both see: 1 the same, 0 nothing in common
};

struct Report {
  Calibration calibration;                           ///< the prior with what was found; checked
  double objective_before = 0, objective_after = 0;  ///< on the finest raymap, 8-bit levels squared
  std::vector<HeadReport> heads;
  std::vector<PairReport> pairs;  ///< that share anything
  std::vector<Step> steps;
  std::vector<std::string> warnings;
};

/// Registers the heads of `prior` on the frames, all frame sets together. The prior says where to start from, and
/// everything that is not sought.
///
/// Threading: thread-safe; starts `threads` of its own for the time of the call.
/// Ownership: the frames' bytes must stay for the time of the call.
/// Errors: kBadValue for frames that do not fit the prior; kNoCoverage when the heads share too little; kNotDetermined for
///   black frames; kHeadMismatch when the frames are not what the prior says the heads see (the same picture twice,
///   mirrored, upside down, another lens, noise). Each says what is wrong and what to try.
Result<Report> register_heads(const Calibration& prior, const std::vector<FrameSet>& frame_sets,
                              const Options& options);

}  // namespace nodal::registration
