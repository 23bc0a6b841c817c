#include "stitch/registration/registration.h"

#include <algorithm>
#include <cmath>

#include "stitch/registration/check_frames.h"
#include "stitch/registration/diagnosis.h"
#include "stitch/registration/run.h"

namespace nodal::registration {
namespace {

constexpr int kQuickWidth = 512;        // of the raymap where usual mistakes are tried
constexpr double kFocalsWrong = 1.0;    // percent, rms; a calibrated lens that was focused anew moves by less
constexpr double kStrictHuber = 0.3;    // of the rms difference: what lines up outweighs what stands near
constexpr double kFocalsExplain = 0.7;  // of the objective, at most so much is left with the right ones

// Focal lengths that are wrong bend the rotations to make up for them, and the result only looks fine. What they are
// when they are sought, too, tells them from things that stand near.
Status check_focals(const Calibration& prior, const std::vector<FrameSet>& frame_sets, const Options& options,
                    double held) {
  Options sought = options;
  sought.free = Free::kFocals;
  sought.progress = nullptr;
  const Result<Report> found = Run(prior, sought).run(frame_sets);
  if (!found || found->objective_after > kFocalsExplain * held) return {};
  double squares = 0, sum = 0;
  for (const HeadReport& head : found->heads) {
    squares += head.focal_change_percent * head.focal_change_percent;
    sum += head.focal_change_percent;
  }
  const auto count = static_cast<double>(found->heads.size());
  const double rms = std::sqrt(squares / count);
  if (rms < kFocalsWrong) return {};
  return fail(Errc::kHeadMismatch, wrong_focals(rms, sum / count, std::sqrt(held),
                                                std::sqrt(found->objective_after)));
}

double least_agreement(const Report& report) {
  double least = 1;
  for (const PairReport& pair : report.pairs) {
    if (pair.shared_sr > kSmallOverlapSr) least = std::min(least, pair.agreement);
  }
  return least;
}

// From a data sheet's lenses there are many valleys, and what stands near the rig decides which one is taken. The descent is
// made a second time with it counting less; the better of the two is that whose worst seam lines up better.
Result<Report> twice(Run& first, const Calibration& prior, const std::vector<FrameSet>& frame_sets, const Options& options) {
  Result<Report> usual = first.run(frame_sets);
  Options again = options;
  if (options.progress) {
    again.progress = [&](const Step& step, double done) { options.progress(step, 0.5 + done / 2); };
  }
  Result<Report> strict = Run(prior, again, kStrictHuber).run(frame_sets);
  const bool better = strict && (!usual || least_agreement(*strict) > least_agreement(*usual));
  return better ? std::move(strict) : std::move(usual);
}

}  // namespace

Result<Report> register_heads(const Calibration& prior, const std::vector<FrameSet>& frame_sets,
                              const Options& options) {
  const bool far_off = options.lens_far_off && options.free == Free::kLens;
  Options once = options;
  if (far_off && options.progress) {
    once.progress = [&](const Step& step, double done) { options.progress(step, done / 2); };
  }
  Run run(prior, once);
  Result<Report> report = far_off ? twice(run, prior, frame_sets, options) : run.run(frame_sets);
  if (run.focals_doubtful()) {
    if (Status right = check_focals(prior, frame_sets, options, run.objective_after()); !right) return fail(right.error());
  }
  if (report || report.error().code != Errc::kHeadMismatch || run.wrong().empty()) return report;
  Options quick = options;
  quick.free = Free::kRotations;
  quick.search = false;
  quick.progress = nullptr;
  quick.width = kQuickWidth;
  const Attempt attempt = [&](const std::vector<FrameSet>& tried) {
    return Run(prior, quick).run(tried).has_value();
  };
  if (const auto mistake = usual_mistake(prior, frame_sets, run.wrong(), attempt)) {
    return fail(Errc::kHeadMismatch, *mistake);
  }
  return report;
}

}  // namespace nodal::registration
