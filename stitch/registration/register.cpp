#include "protocol/base/try.h"
#include "stitch/registration/registration.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "stitch/registration/check_frames.h"
#include "stitch/registration/diagnosis.h"
#include "stitch/registration/known_lens.h"
#include "stitch/registration/run.h"
#include "stitch/registration/seen_radii.h"

namespace nodal::registration {
namespace {

constexpr int kQuickWidth = 512;        // width of the raymap on which common mistakes are tried
constexpr double kFocalsWrong = 1.0;    // percent, rms; refocusing a calibrated lens changes it by less
constexpr double kFocalsExplain = 0.7;  // largest share of the objective that may remain with right focal lengths

// Wrong focal lengths are compensated by wrong rotations, and the result only looks right. Estimating the focal
// lengths, too, distinguishes this from objects close to the rig.
Status check_focals(const Calibration& prior, const LitFrames& frames, const Options& options, double held) {
  Options sought = options;
  sought.free = Free::kFocals;
  sought.progress = nullptr;
  const Result<Report> found = Run(prior, sought).run(frames);
  if (!found || found->objective_after > kFocalsExplain * held) return {};
  double squares = 0, sum = 0;
  for (const HeadReport& head : found->heads) {
    squares += head.focal_change_percent * head.focal_change_percent;
    sum += head.focal_change_percent;
  }
  const auto count = static_cast<double>(found->heads.size());
  const double rms = std::sqrt(squares / count);
  if (rms < kFocalsWrong) return {};
  return fail(Errc::kHeadMismatch, wrong_focals(rms, sum / count, std::sqrt(held), std::sqrt(found->objective_after)));
}

// If whole lenses leave less than one part in this of the differences that focal lengths leave, then lenses are wrong,
// too.
constexpr double kLensesExplain = 2;

/// A head that was left out, and why.
struct LeftOut {
  std::size_t head = 0;
  std::string why;
};

/// The mistake that explains why the heads in `wrong` disagree with the others, if it is a usual one.
std::optional<std::string> mistake_of(const Calibration& prior, const std::vector<FrameSet>& frame_sets,
                                      const Options& options, const std::vector<std::size_t>& wrong) {
  Options quick = options;
  quick.free = Free::kRotations;
  quick.search = false;
  quick.progress = nullptr;
  quick.width = kQuickWidth;
  const Attempt attempt = [&](const std::vector<FrameSet>& tried) {
    const Result<LitFrames> frames = LitFrames::of(prior, tried, quick.colour, quick.threads);
    if (!frames) return false;
    // A head without detail agrees with nothing, and is only not placed.
    const Result<Report> report = Run(prior, quick).run(*frames);
    return report && std::ranges::all_of(report->heads, &HeadReport::placed);
  };
  return usual_mistake(prior, frame_sets, wrong, attempt);
}

/// A report, and why its heads do not agree everywhere.
struct Registered {
  Report report;
  Cause cause = Cause::kNone;
  double displaced_px = 0;
};

/// Leaves out heads one by one that contradict all others.
Result<Registered> register_with(const Calibration& prior, const LitFrames& frames, const Options& options) {
  for (std::vector<LeftOut> left_out;;) {
    Run run(prior, options);
    for (const LeftOut& one : left_out) run.leave_out(one.head, one.why);
    Result<Report> report = run.run(frames);
    if (options.free == Free::kRotations && (run.cause() == Cause::kFocals || run.cause() == Cause::kLenses)) {
      NODAL_TRY(check_focals(prior, frames, options, run.objective_after()));
    }
    if (report) return Registered{std::move(*report), run.cause(), run.displaced_px()};
    if (report.error().code != Errc::kHeadMismatch || run.wrong().empty()) return fail(report.error());
    std::optional<std::string> mistake;
    if (options.diagnose) mistake = mistake_of(prior, frames.frame_sets, options, run.wrong());
    if (mistake) return fail(Errc::kHeadMismatch, *mistake);
    // One head alone must not refuse the others, if those that are left can contradict each other.
    if (run.wrong().size() != 1 || prior.heads.size() - left_out.size() < 4) return fail(report.error());
    const std::size_t head = run.wrong().front();
    left_out.push_back({head, disagreement(run.little_detail(head), run.agreement(head))});
  }
}

/// Whether overlaps show too little of the lenses for whole lenses: the rest would be extrapolated, by tens of percent
/// wrong, and heads agree nevertheless. False if heads do not overlap at all.
Result<bool> too_thin(const Calibration& prior, const Options& options) {
  if (!options.geometry) return false;
  NODAL_TRY_ASSIGN(const SeenRadii seen, seen_radii(prior));
  return seen.span > 0 && !seen.determine_lenses();
}

/// A report, and which parameters were estimated.
struct Sure {
  Report report;
  Free estimated = Free::kRotations;
};

/// Registers with fewer parameters of lenses if those asked for cannot be trusted: if overlaps show too little of the
/// lenses, if there is no result with them, or if near things would bend whole lenses.
Result<Sure> register_what_is_sure(const Calibration& prior, const LitFrames& frames, const Options& options,
                                   bool thin) {
  thin = thin && options.free == Free::kLens;
  Result<Registered> asked = fail(Errc::kNotDetermined, "not tried");
  if (!thin) asked = register_with(prior, frames, options);
  if (options.free == Free::kRotations || !options.geometry) {
    if (!asked) return fail(asked.error());
    return Sure{std::move(asked->report), options.free};
  }
  const bool bent = asked && options.free == Free::kLens && asked->cause == Cause::kNearThings;
  if (asked && !bent) return Sure{std::move(asked->report), options.free};
  Options fewer = options;
  fewer.lens_far_off = false;
  Error last = asked ? Error{} : asked.error();
  while (fewer.free != Free::kRotations) {
    fewer.free = fewer.free == Free::kLens ? Free::kFocals : Free::kRotations;
    Result<Registered> found = register_with(prior, frames, fewer);
    const bool worse = found && bent && found->report.objective_after > kLensesExplain * asked->report.objective_after;
    if (bent && (!found || worse)) return Sure{std::move(asked->report), options.free};
    if (!found && thin) last = found.error();
    if (!found) continue;
    if (!thin) {
      found->report.warnings.push_back(fewer_lens_parameters(
          options.free, fewer.free, bent ? std::string() : asked.error().message, bent ? asked->displaced_px : 0));
    }
    return Sure{std::move(found->report), fewer.free};
  }
  return fail(last);
}

}  // namespace

Result<Report> register_heads(const Calibration& prior, const std::vector<FrameSet>& frame_sets,
                              const Options& options) {
  NODAL_TRY_ASSIGN(const LitFrames frames, LitFrames::of(prior, frame_sets, options.colour, options.threads));
  return register_heads(prior, frames, options);
}

Result<Report> register_heads(const Calibration& prior, const LitFrames& frames, const Options& asked) {
  if (frames.colour != asked.colour || frames.pyramids->size() != prior.heads.size()) {
    return fail(Errc::kBadValue, "the frames were prepared for other colours or other heads");
  }
  Options options = asked;
  options.distance = options.distance && options.geometry;
  if (options.distance && farthest_position(prior) == 0) {
    return fail(Errc::kBadValue,
                "a distance is estimated from where heads are, and no head of the calibration has a position; add "
                "`position` to its heads (CALIBRATION.md), or import a project that has them");
  }
  // Positions are given in the rig's frame, so the rig as a whole cannot be turned afterwards.
  if (options.distance || prior.distance > 0) options.gauge = Gauge::kFirstHead;
  NODAL_TRY_ASSIGN(const bool thin, too_thin(prior, options));
  // If two stereographic lenses look away from each other, one focal length may be multiplied by what the other one is
  // divided by, and the pictures fit as well. Those of other lenses nearly do, and near things decide between them.
  options.one_lens = options.one_lens || thin;
  NODAL_TRY_ASSIGN(Sure sure, register_what_is_sure(prior, frames, options, thin));
  if (!thin || (options.free == Free::kRotations && !options.lens_kind_assumed)) return std::move(sure.report);
  NODAL_TRY_ASSIGN(const SeenRadii seen, seen_radii(sure.report.calibration));
  NODAL_TRY_ASSIGN(const KnownLens known, known_lens(sure.report.calibration, seen, options, sure.estimated));
  sure.report.lens = known;
  sure.report.calibration.comment = commented(sure.report.calibration.comment, known);
  sure.report.warnings.push_back(thin_overlaps(options, sure.estimated, seen, known));
  return std::move(sure.report);
}

}  // namespace nodal::registration
