#include "host_tool/commands/trial.h"

#include <fmt/format.h>

#include <cmath>

#include "host_tool/console/interrupt.h"
#include "host_tool/input/live_frames.h"
#include "host_tool/rig/frame_period.h"
#include "host_tool/rig/upload.h"
#include "protocol/base/frame_time.h"
#include "protocol/base/try.h"
#include "stitch/registration/drift.h"

namespace nodal::host {
namespace {

constexpr int kTrialUploadAttempts = 4;
constexpr int kTrialPeriods = 40;
constexpr double kMinFall = 0.001;  // share of the objective; repeating the same calibration must not count as better

/// Ends the trial on the rig in its destructor, unless it has been ended before.
class TrialUnderWay {
 public:
  TrialUnderWay(RigConnection& rig, const Calibration& tried) : rig_(rig) {
    const Sha256 id = calibration_id(tried);
    id_.assign(id.begin(), id.end());
  }
  TrialUnderWay(const TrialUnderWay&) = delete;
  TrialUnderWay& operator=(const TrialUnderWay&) = delete;
  ~TrialUnderWay() {
    if (!ended_) (void)end(false);  // if the rig does not receive it, the trial's time limit has the same effect
  }

  Status end(bool keep) {
    wire::Request request;
    request.mutable_trial_end()->set_id(id_);
    request.mutable_trial_end()->set_keep(keep);
    NODAL_TRY(rig_.ask(request));
    ended_ = true;
    return {};
  }

 private:
  RigConnection& rig_;
  std::string id_;
  bool ended_ = false;
};

}  // namespace

Result<TrialVerdict> try_out(Context& context, const Calibration& tried, int sets, UploadTerms terms,
                             std::string document) {
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  for (const char* feature : {"calibration-trial", "frame-sets"}) {
    NODAL_TRY(require_feature(*rig, feature, "a trial"));
  }
  NODAL_TRY_ASSIGN(const Calibration before, calibration_in_force(*rig));
  if (document.empty()) document = to_json(tried);
  NODAL_TRY_ASSIGN(const Duration period, frame_period(*rig));
  terms.trial = FrameTime{terms.trial.value_or(kTrialLimit), kTrialPeriods}.at(period);
  const Reconnect connect = [&context] { return context.connect(); };
  NODAL_TRY(upload(connect, {document.begin(), document.end()}, kTrialUploadAttempts, context.console(), terms));
  TrialUnderWay trial(*rig, tried);
  NODAL_TRY_ASSIGN(const RigPictures pictures, pull_frame_sets(*rig, tried, sets, context.console()));
  // A signal here ends the program; for the rig that is a lost link, and the rig reverts by itself.
  NODAL_TRY_ASSIGN(const auto objectives, interruptible(context.console(), [&] {
                     return registration::objectives_of({before, tried}, pictures.frames(), {});
                   }));
  TrialVerdict verdict{objectives.front(), objectives.back(), false};
  verdict.kept = verdict.after < verdict.before * (1 - kMinFall);
  NODAL_TRY(trial.end(verdict.kept));
  return verdict;
}

void tell_verdict(Context& context, const TrialVerdict& verdict) {
  Console& console = context.console();
  console.document(
      {{"trial", {{"objective_before", verdict.before}, {"objective_after", verdict.after}, {"kept", verdict.kept}}}});
  const std::string figures = fmt::format(
      "on frames taken during the trial, the heads differ by {:.3f} levels of 255 with it, by {:.3f} with the previous "
      "one",
      std::sqrt(verdict.after), std::sqrt(verdict.before));
  if (!verdict.kept) {
    console.warning("the calibration that was tried is not better, and the rig uses the previous one again: " +
                    figures);
    context.answer = ExitCode::kJudged;
    return;
  }
  console.line("kept: " + figures);
}

}  // namespace nodal::host
