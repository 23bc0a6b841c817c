#include "firmware/operate/health.h"

#include <algorithm>
#include <cstdio>

#include "protocol/base/text.h"

namespace nodal::firmware {
namespace {

constexpr Duration kSilence = Duration::milliseconds(1500);
constexpr Duration kSettling = Duration::seconds(5);

std::string hertz(std::uint32_t millihertz) {
  char text[32];
  std::snprintf(text, sizeof text, "%u.%02u", millihertz / 1000, millihertz % 1000 / 10);
  return text;
}

/// "head 'cam3'", "heads 'cam3', 'cam4'" of those that are away, with the first one's reason.
std::string absent_heads(const RigConfig& config, const CaptureReport& capture) {
  std::string names, reason;
  std::size_t count = 0;
  for (std::size_t i = 0; i < capture.heads.size(); ++i) {
    const HeadReport& head = capture.heads[i];
    if (head.present) continue;
    names += (count++ == 0 ? "'" : ", '") + config.heads[i].name + "'";
    if (reason.empty()) reason = head.problem;
  }
  if (count == 0) return "";
  return (count == 1 ? "head " : "heads ") + names + (count == 1 ? " is" : " are") + " not there: " + reason;
}

std::string first_head_problem(const RigConfig& config, const CaptureReport& capture) {
  for (std::size_t i = 0; i < capture.heads.size(); ++i) {
    if (capture.heads[i].present && !capture.heads[i].problem.empty()) {
      return "head '" + config.heads[i].name + "': " + capture.heads[i].problem;
    }
  }
  return "";
}

std::string too_slow(const Signs& signs) {
  std::string shed;
  if (signs.shed.publish_every > 1)
    shed = "; hosts are given one raymap of " + std::to_string(signs.shed.publish_every);
  if (signs.shed.preview_every > 1)
    shed += ", and one set of " + std::to_string(signs.shed.preview_every) + " is blended";
  const std::uint64_t enough = std::uint64_t{signs.rate_wanted_millihertz} * 95 / 100;
  const bool slow = signs.blending > kSettling && signs.rate_millihertz > 0 && signs.rate_millihertz < enough;
  if (!slow) return shed.empty() ? "" : "the board cannot do all of it" + shed;
  return hertz(signs.rate_millihertz) + " raymaps a second are made of the rig's " +
         hertz(signs.rate_wanted_millihertz) + "; the board is too slow for this size, or busy" + shed;
}

/// All columns but kStopping, which nothing leaves.
struct Row {
  RigState to;
  Acts acts;
};
constexpr std::array<Row, kConditions> kTable = [] {
  std::array<Row, kConditions> table{};
  constexpr Acts kServe{true, true, false};
  const auto row = [&](Condition when, RigState to, Acts acts) { table[static_cast<std::size_t>(when)] = {to, acts}; };
  row(Condition::kEnding, RigState::kStopping, {false, true, true});
  row(Condition::kStageHangs, RigState::kHanging, {false, false, false});
  row(Condition::kStoreUnread, RigState::kStarting, {false, true, false});
  row(Condition::kNoCalibration, RigState::kNoCalibration, kServe);
  row(Condition::kNoFrames, RigState::kIdle, kServe);
  for (const Condition worse :
       {Condition::kHeadAway, Condition::kGenlockLost, Condition::kHoldover, Condition::kUnfitFrames,
        Condition::kStoreTrouble, Condition::kHeadTrouble, Condition::kTooSlow}) {
    row(worse, RigState::kDegraded, kServe);
  }
  row(Condition::kWell, RigState::kRunning, kServe);
  return table;
}();

}  // namespace

std::string_view rig_state_name(RigState state) {
  constexpr std::array<std::string_view, kRigStates> kNames{"starting", "no-calibration", "idle",    "running",
                                                            "degraded", "hanging",        "stopping"};
  return kNames[static_cast<std::size_t>(state)];
}

Transition transition(Condition worst, RigState from) {
  const Row& row = kTable[static_cast<std::size_t>(from == RigState::kStopping ? Condition::kEnding : worst)];
  return {row.to, row.acts};
}

Finding find_condition(const RigConfig& config, const Signs& signs) {
  const auto found = [](Condition condition, std::string sentence) { return Finding{condition, std::move(sentence)}; };
  if (!signs.keeper.ready) {
    return found(Condition::kStoreUnread,
                 signs.keeper.activity.empty() ? "reading the calibration store" : signs.keeper.activity);
  }
  if (!signs.keeper.in_force) {
    return found(Condition::kNoCalibration,
                 signs.keeper.problem.empty() ? "no calibration is in force; upload one: nodal calibration upload FILE"
                                              : signs.keeper.problem);
  }
  std::string absent = absent_heads(config, signs.capture);
  if (signs.since_last_set > kSilence) {
    return found(Condition::kNoFrames, "no frames are coming" + (absent.empty() ? std::string() : "; " + absent));
  }
  if (!absent.empty()) return found(Condition::kHeadAway, std::move(absent));
  if (signs.capture.genlock.state == GenlockState::kLost) {
    return found(Condition::kGenlockLost, "the genlock is lost: heads are no longer exposed together");
  }
  if (signs.capture.genlock.state == GenlockState::kHoldover) {
    return found(Condition::kHoldover, signs.capture.genlock.aligned
                                           ? "a head does not move as it is asked; the heads are still in step"
                                           : "the trigger's pulses are not seen; the heads still run in step");
  }
  if (signs.unfit_frames > 0) {
    return found(Condition::kUnfitFrames, "frames come that are not of the size or format the calibration is for");
  }
  if (!signs.keeper.problem.empty()) return found(Condition::kStoreTrouble, signs.keeper.problem);
  if (!signs.settings_problem.empty()) return found(Condition::kStoreTrouble, signs.settings_problem);
  if (std::string problem = first_head_problem(config, signs.capture); !problem.empty()) {
    return found(Condition::kHeadTrouble, std::move(problem));
  }
  if (std::string slow = too_slow(signs); !slow.empty()) return found(Condition::kTooSlow, std::move(slow));
  return {};
}

void Supervisor::end(std::string reason) {
  if (!ending_) ending_ = std::move(reason);
}

void Supervisor::step(const std::vector<Stage>& stages, const Finding& found, Instant now) {
  const std::optional<std::string_view> stuck = find_stuck(stages, now);
  Condition worst = found.condition;
  std::string sentence = found.sentence;
  if (ending_) {
    worst = Condition::kEnding;
    sentence = *ending_;
  } else if (stuck) {
    worst = Condition::kStageHangs;
    sentence = std::string(*stuck) + " does not get on";
  }
  const Transition next = transition(worst, state_);
  state_ = next.to;
  acts_ = next.acts;
  health_ = {rig_state_name(state_), std::move(sentence)};
  tell(acts_, now);
}

std::optional<std::string_view> Supervisor::find_stuck(const std::vector<Stage>& stages, Instant now) {
  seen_.resize(stages.size(), Seen{0, now});
  std::optional<std::string_view> stuck;
  for (std::size_t i = 0; i < stages.size(); ++i) {
    if (stages[i].may_rest || stages[i].progress != seen_[i].progress) {
      seen_[i] = {stages[i].progress, now};
    } else if (!stuck && now - seen_[i].at > kStuckAfter) {
      stuck = stages[i].name;
    }
  }
  return stuck;
}

void Supervisor::tell(const Acts& acts, Instant now) {
  if (!watchdog_) return;
  if (acts.ready && !told_ready_) {
    watchdog_->ready();
    told_ready_ = true;
  }
  if (acts.end && !told_end_) {
    watchdog_->stopping();
    told_end_ = true;
  }
  if (fed_ && now - *fed_ < kFeedEvery) return;
  fed_ = now;
  if (acts.feed) watchdog_->feed();
  std::string line(health_.state);
  if (!health_.problem.empty()) line += ": " + health_.problem;
  if (line == told_) return;
  constexpr std::size_t kLongest = 512;  // bytes
  watchdog_->status(printable(line, kLongest));
  told_ = std::move(line);
}

}  // namespace nodal::firmware
