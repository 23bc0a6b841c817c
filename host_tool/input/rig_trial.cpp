#include "host_tool/input/rig_trial.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "host_tool/console/interrupt.h"
#include "host_tool/input/live_frames.h"
#include "host_tool/rig/frame_period.h"
#include "protocol/base/frame_time.h"
#include "protocol/base/try.h"
#include "stitch/registration/drift.h"

namespace nodal::host {
namespace {

constexpr int kUploadAttempts = 4;
constexpr int kPeriods = 40;
constexpr double kMinFall = 0.001;  // share of the objective; repeating the same calibration must not count as better

}  // namespace

bool TrialFigures::better() const { return after < before * (1 - kMinFall); }

std::string TrialFigures::text() const {
  return fmt::format(
      "on frames taken during the trial, the heads differ by {:.3f} levels of 255 with it, by {:.3f} with the previous "
      "one",
      std::sqrt(after), std::sqrt(before));
}

RigTrial::RigTrial(Reconnect connect, Calibration tried) : connect_(std::move(connect)), tried_(std::move(tried)) {}

RigTrial::~RigTrial() {
  if (ended_) return;
  const LastRequest after_signal;
  (void)end(false);  // if the rig does not receive it, the trial's time limit has the same effect
}

Result<std::unique_ptr<RigTrial>> RigTrial::begin(const Reconnect& connect, const Calibration& tried, UploadTerms terms,
                                                  std::string document, Console& console) {
  std::unique_ptr<RigTrial> trial(new RigTrial(connect, tried));
  trial->ended_ = true;  // nothing is on trial yet
  NODAL_TRY_ASSIGN(trial->rig_, connect());
  RigConnection& rig = *trial->rig_;
  for (const char* feature : {"calibration-trial", "frame-sets"}) {
    NODAL_TRY(require_feature(rig, feature, "a trial"));
  }
  NODAL_TRY_ASSIGN(trial->before_, calibration_in_force(rig));
  if (document.empty()) document = to_json(tried);
  NODAL_TRY_ASSIGN(const Duration period, frame_period(rig));
  trial->limit_ = FrameTime{terms.trial.value_or(kUsualLimit), kPeriods}.at(period);
  terms.trial = trial->limit_;
  NODAL_TRY(upload(connect, {document.begin(), document.end()}, kUploadAttempts, console, terms));
  trial->ended_ = false;
  return trial;
}

Result<RigPictures> RigTrial::pull(int sets, Console& console) { return pull_frame_sets(*rig_, tried_, sets, console); }

Result<TrialFigures> RigTrial::compare(const RigPictures& pictures) const {
  NODAL_TRY_ASSIGN(const auto objectives, registration::objectives_of({before_, tried_}, pictures.frames(), {}));
  return TrialFigures{objectives.front(), objectives.back()};
}

Status RigTrial::end(bool keep) {
  if (rig_ == nullptr) {
    NODAL_TRY_ASSIGN(rig_, connect_());
  }
  const Sha256 id = calibration_id(tried_);
  wire::Request request;
  request.mutable_trial_end()->set_id(std::string(id.begin(), id.end()));
  request.mutable_trial_end()->set_keep(keep);
  NODAL_TRY(rig_->ask(request));
  ended_ = true;
  return {};
}

}  // namespace nodal::host
