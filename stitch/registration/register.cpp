#include "stitch/registration/registration.h"

#include <cmath>

#include "stitch/registration/check_frames.h"
#include "stitch/registration/diagnosis.h"
#include "stitch/registration/run.h"

namespace nodal::registration {
namespace {

constexpr int kQuickWidth = 512;        // width of the raymap on which common mistakes are tried
constexpr double kFocalsWrong = 1.0;    // percent, rms; refocusing a calibrated lens changes it by less
constexpr double kFocalsExplain = 0.7;  // largest share of the objective that may remain with right focal lengths

// Wrong focal lengths are compensated by wrong rotations, and the result only looks right. Estimating the focal
// lengths, too, distinguishes this from objects close to the rig.
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
  return fail(Errc::kHeadMismatch, wrong_focals(rms, sum / count, std::sqrt(held), std::sqrt(found->objective_after)));
}

}  // namespace

Result<Report> register_heads(const Calibration& prior, const std::vector<FrameSet>& frame_sets,
                              const Options& options) {
  Run run(prior, options);
  Result<Report> report = run.run(frame_sets);
  if (run.focals_doubtful()) {
    if (Status right = check_focals(prior, frame_sets, options, run.objective_after()); !right)
      return fail(right.error());
  }
  if (report || report.error().code != Errc::kHeadMismatch || run.wrong().empty()) return report;
  Options quick = options;
  quick.free = Free::kRotations;
  quick.search = false;
  quick.progress = nullptr;
  quick.width = kQuickWidth;
  const Attempt attempt = [&](const std::vector<FrameSet>& tried) { return Run(prior, quick).run(tried).has_value(); };
  if (const auto mistake = usual_mistake(prior, frame_sets, run.wrong(), attempt)) {
    return fail(Errc::kHeadMismatch, *mistake);
  }
  return report;
}

}  // namespace nodal::registration
