#include "host_tool/look/trials.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>

#include "host_tool/input/live_frames.h"
#include "protocol/base/try.h"

namespace nodal::host::look {

const char* Trials::name_of(Phase phase) {
  switch (phase) {
    case Phase::kNone: return "none";
    case Phase::kUploading: return "uploading";
    case Phase::kComparing: return "comparing";
    case Phase::kOnTrial: return "on trial";
    case Phase::kEnding: return "ending";
    case Phase::kKept: return "kept";
    case Phase::kDropped: return "dropped";
    case Phase::kExpired: return "expired";
    case Phase::kFailed: return "failed";
  }
  return "";
}

bool Trials::under_way(Phase phase) {
  return phase == Phase::kUploading || phase == Phase::kComparing || phase == Phase::kOnTrial ||
         phase == Phase::kEnding;
}

Trials::~Trials() {
  {
    const std::lock_guard lock(mutex_);
    if (!decision_) decision_ = false;
    changed_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
}

Status Trials::begin(Calibration tried) {
  {
    const std::lock_guard lock(mutex_);
    if (under_way(phase_)) return fail(Errc::kWrongState, "A calibration is on trial already; keep or drop it first.");
    phase_ = Phase::kUploading;
    says_ = "The calibration is on its way to the rig.";
    decision_.reset();
  }
  if (thread_.joinable()) thread_.join();
  thread_ = std::thread([this, calibration = std::move(tried)] { run(calibration); });
  return {};
}

Status Trials::end(bool keep) {
  const std::lock_guard lock(mutex_);
  if (phase_ != Phase::kComparing && phase_ != Phase::kOnTrial)
    return fail(Errc::kWrongState, "Nothing is on trial on the rig.");
  decision_ = keep;
  changed_.notify_all();
  return {};
}

void Trials::set(Phase phase, std::string says) {
  const std::lock_guard lock(mutex_);
  phase_ = phase;
  says_ = std::move(says);
  if (phase == Phase::kUploading || !under_way(phase)) until_.reset();
}

std::optional<bool> Trials::decided() {
  std::unique_lock lock(mutex_);
  const Duration left = *until_ - steady_now();
  changed_.wait_for(lock, std::chrono::nanoseconds(left.ns()), [&] { return decision_.has_value(); });
  return decision_;
}

void Trials::run(const Calibration& tried) {
  Console console(stdout, stderr);  // progress, on the terminal
  std::string consequence;          // appended to the message of an error
  const auto ended = [&]() -> Result<std::pair<Phase, std::string>> {
    NODAL_TRY_ASSIGN(const std::unique_ptr<RigTrial> trial, RigTrial::begin(connect_, tried, {limit_}, "", console));
    consequence = "; the rig goes back to the previous calibration, at the latest by itself";
    {
      const std::lock_guard lock(mutex_);
      until_ = steady_now() + trial->limit();
    }
    set(Phase::kComparing, "The rig blends with it; both calibrations are compared on new frames.");
    NODAL_TRY_ASSIGN(const RigPictures pictures, trial->pull(kLiveSets, console));
    trial->hang_up();
    NODAL_TRY_ASSIGN(const TrialFigures figures, trial->compare(pictures));
    set(Phase::kOnTrial, (figures.better() ? "It is better: " : "It is not better: ") + figures.text() + ".");
    const std::optional<bool> keep = decided();
    if (!keep)
      return std::pair(Phase::kExpired, std::string("Nobody kept it in time; the rig uses the previous one again."));
    set(Phase::kEnding, *keep ? "The rig stores it." : "The rig goes back to the previous one.");
    if (*keep) consequence = "; `nodal calibration list` says which calibration the rig uses now";
    NODAL_TRY(trial->end(*keep));
    return *keep ? std::pair(Phase::kKept, std::string("The rig keeps it and uses it from now on."))
                 : std::pair(Phase::kDropped, std::string("Dropped; the rig uses the previous one again."));
  }();
  if (ended) {
    set(ended->first, ended->second);
  } else {
    set(Phase::kFailed, ended.error().message + consequence);
  }
}

nlohmann::ordered_json Trials::state() const {
  const std::lock_guard lock(mutex_);
  if (phase_ == Phase::kNone) return nullptr;
  nlohmann::ordered_json json{
      {"phase", name_of(phase_)}, {"says", says_}, {"under_way", under_way(phase_)}, {"left_s", nullptr}};
  if (until_) json["left_s"] = static_cast<double>(std::max(Duration(), *until_ - steady_now()).ns()) / 1e9;
  return json;
}

}  // namespace nodal::host::look
