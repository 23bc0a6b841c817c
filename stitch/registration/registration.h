// Registration (§4.2, §4.4): estimates the rotations, lenses and light of a rig's heads by minimizing the differences
// of the rays that they share.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::registration {

/// The frames that one trigger exposed: one picture per head, in the calibration's order. Not kMjpeg.
using FrameSet = std::vector<ImageView>;

/// What is estimated besides gain and vignetting; each value includes those before it.
enum class Free : std::uint8_t {
  kRotations,
  kFocals,  ///< also one scale per head
  kLens,    ///< also centre and radial coefficients per head
};
/// How the heads' differences on one ray count (§4.2): all of them, or only the worst one.
enum class Norm : std::uint8_t { kSum, kMax };
/// Which values are compared: luminance; or red, green and blue, each with its own gain.
enum class Colour : std::uint8_t { kLuminance, kRgb };
/// How fall-offs are estimated. If all heads share only their rims, they keep the prior's.
enum class VignettingModel : std::uint8_t {
  kFixed,   ///< the prior's
  kShared,  ///< the same fall-off for every head, about its own lens centre
  kOwn,     ///< one per head; a head that shares only its rim, which does not determine it, gets the mean of the others
};
/// What fixes the rotation of the whole rig, which overlaps do not determine.
enum class Gauge : std::uint8_t {
  kFirstHead,  ///< the first placed head keeps the prior's rotation
  kMean,       ///< the heads' turns have mean zero
  kMedian,     ///< the heads' turns have geometric median zero: heads that moved do not affect heads that did not
};
// With a distance, kFirstHead is used whatever is asked for.

/// One accepted step of the descent.
struct Step {
  int width = 0;          ///< width of the raymap that the objective is summed on, px
  int level = 0;          ///< level of the pictures' pyramid; 0: full size, each next level half of it
  int iteration = 0;      ///< 0: the start of the level
  double objective = 0;   ///< mean squared difference of the shared rays, 8-bit levels squared
  double turned_deg = 0;  ///< the largest turn of a head in this step
};

struct Options {
  Free free = Free::kRotations;
  /// False: rotations and lenses are fixed, and `free` has no effect; only gains and fall-off are estimated.
  bool geometry = true;
  /// Estimates the pixels' aspect, too, one change for all heads. Where it is 1, as in most cameras, leave it so.
  bool aspect = false;
  /// Estimates Calibration::distance, too: where the pictures of heads with positions meet.
  bool distance = false;
  Norm norm = Norm::kSum;
  Colour colour = Colour::kLuminance;
  bool gains = true;
  VignettingModel vignetting = VignettingModel::kOwn;
  Gauge gauge = Gauge::kFirstHead;
  /// The raymap that the objective is summed on; the result depends on it (§4.2).
  std::string layout = "equirectangular";
  /// The finest raymap has as many rays as an equirectangular one of this width; 0: the resolution of the pictures.
  int width = 0;
  /// With Free::kLens: only the type of the prior's lenses is right. Lenses are estimated from the coarsest level on,
  /// at first one lens for all heads. Gives way to focal lengths and rotations, with a warning, as Free::kLens does.
  bool lens_far_off = false;
  /// The type of the prior's lenses is an assumption, too: where overlaps show little of the lenses, other types fit.
  bool lens_kind_assumed = false;
  /// Focal lengths, and other parameters of lenses, change alike for all heads. Set where overlaps are thin.
  bool one_lens = false;
  /// Searches for heads that are far from the prior, before the descent.
  bool search = true;
  /// When heads disagree, tries whether pictures are upside down or mirrored. False: they are known not to be.
  bool diagnose = true;
  int threads = 0;  ///< 0: one per core. The result does not depend on it.
  /// Called on the caller's thread after every accepted step, with the share of the work that is done (0..1).
  std::function<void(const Step&, double)> progress;
};

struct HeadReport {
  std::string name;
  bool placed = true;     ///< false: the frames do not determine its rotation, and it keeps the prior's
  std::string why_not;    ///< one sentence, if it is not placed
  double turned_deg = 0;  ///< from the prior
  double sigma_deg = 0;   ///< standard deviation of its rotation about its worst axis; for an unplaced head
                          ///< from the frames alone, infinite if they do not determine it
  double focal_change_percent = 0;
  double sigma_focal_percent = 0;  ///< 0 if not estimated
  double shared_sr = 0;            ///< the part of its view that other heads see, too
};

/// How two heads agree on the rays that they share.
struct PairReport {
  int a = 0, b = 0;  ///< indices of heads, a < b
  double shared_sr = 0;
  double rms_before = 0;  ///< rms difference in 8-bit levels, with the prior
  double rms_after = 0;
  double agreement = 0;  ///< correlation of the detail that both see: 1 the same, 0 nothing in common
};

/// Where the lenses of a result are known to 2 %, from their axes, in pixels of the first head; and how wrong they may
/// be elsewhere, as a share of the distance from the axis. 0: elsewhere they are the prior's.
struct KnownLens {
  double from_deg = 0, to_deg = 0;
  double from_px = 0, to_px = 0;
  double unsure = 0;
};

struct Report {
  Calibration calibration;  ///< the prior with the estimated parameters; checked
  /// With Options::distance: the standard deviation of 1 / calibration.distance, 1/m.
  double sigma_nearness = 0;
  double objective_before = 0, objective_after = 0;  ///< on the finest raymap, 8-bit levels squared
  std::vector<HeadReport> heads;
  std::vector<PairReport> pairs;  ///< all pairs that overlap
  std::vector<Step> steps;
  std::optional<KnownLens> lens;  ///< only if overlaps show too little of the lenses to determine them
  std::vector<std::string> warnings;
};

struct HeadPyramid;

/// Frames and their light at every size, for several runs over the same frames.
///
/// Threading: immutable. Ownership: refers to the frames' bytes.
struct LitFrames {
  std::vector<FrameSet> frame_sets;
  Colour colour = Colour::kLuminance;
  std::shared_ptr<const std::vector<HeadPyramid>> pyramids;

  /// Uses the responses and the regions of `calibration`; runs must have the same.
  /// Errors: kBadValue, kNotDetermined and kHeadMismatch of register_heads().
  static Result<LitFrames> of(const Calibration& calibration, const std::vector<FrameSet>& frame_sets, Colour colour,
                              int threads);
};

/// Registers the heads of `prior` on the frames, all frame sets together. The prior gives the start, and all parameters
/// that are not estimated.
///
/// Threading: thread-safe; starts `threads` of its own for the time of the call.
/// Ownership: the frames' bytes must remain valid during the call.
/// Errors: kBadValue for frames that do not fit the prior; kNoCoverage if the heads share too little; kNotDetermined
///   for black frames; kHeadMismatch if the frames contradict the prior (the same picture twice, mirrored, upside down,
///   another lens, noise). Each message says what is wrong and what to try. One head that contradicts three or more
///   others is left out and reported as not placed.
Result<Report> register_heads(const Calibration& prior, const std::vector<FrameSet>& frame_sets,
                              const Options& options);
/// The same; `frames` must be of the options' colour.
Result<Report> register_heads(const Calibration& prior, const LitFrames& frames, const Options& options);

}  // namespace nodal::registration
