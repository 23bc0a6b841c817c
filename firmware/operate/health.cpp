#include "firmware/operate/health.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "protocol/base/text.h"
#include "stitch/decode/jpeg_frame.h"

namespace nodal::firmware {
namespace {

constexpr FrameTime kSettling{Duration::seconds(5), 4};
constexpr Duration kLossShown = Duration::seconds(10);

std::string hertz(std::uint32_t millihertz) {
  char text[32];
  if (millihertz < 100) std::snprintf(text, sizeof text, "0.%03u", millihertz);
  else std::snprintf(text, sizeof text, "%u.%02u", millihertz / 1000, millihertz % 1000 / 10);
  return text;
}

/// "head 'cam3' is missing: REASON" or "heads 'cam3', 'cam4' are missing: REASON OF THE FIRST"; empty if none is
/// missing.
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
  return (count == 1 ? "head " : "heads ") + names + (count == 1 ? " is" : " are") + " missing: " + reason;
}

/// Says why no new set has a frame of this head.
std::string without_frames(const RigConfig& config, const CaptureReport& capture, std::size_t head) {
  const std::optional<LossReason>& loss = capture.heads[head].newest_loss;
  return "head '" + config.heads[head].name +
         (loss ? "': none of its frames can be used; the newest: " + std::string(loss_reason_name(*loss))
               : "' delivers no frames");
}

std::string first_head_problem(const RigConfig& config, const CaptureReport& capture) {
  for (std::size_t i = 0; i < capture.heads.size(); ++i) {
    const HeadReport& head = capture.heads[i];
    if (!head.present) continue;
    if (!head.problem.empty()) return "head '" + config.heads[i].name + "': " + head.problem;
    if (head.in_no_set) return without_frames(config, capture, i);
  }
  return "";
}

std::string too_slow(const HealthInputs& inputs) {
  std::string shed;
  if (inputs.shed.publish_every > 1) shed = fmt::format("; hosts get 1 of {} raymaps", inputs.shed.publish_every);
  if (inputs.shed.preview_every > 1) shed += fmt::format(", 1 of {} sets is blended", inputs.shed.preview_every);
  const std::uint64_t enough = std::uint64_t{inputs.rate_wanted_millihertz} * 95 / 100;
  const bool slow = inputs.blending > kSettling.at(inputs.capture.genlock.rate.period()) &&
                    inputs.rate_millihertz > 0 && inputs.rate_millihertz < enough;
  if (!slow) return shed.empty() ? "" : "the board is overloaded" + shed;
  return hertz(inputs.rate_millihertz) + " raymaps a second are made instead of " +
         hertz(inputs.rate_wanted_millihertz) + "; the board is too slow for this raymap size, or busy" + shed;
}

/// What is lost because the disk is too slow, or why the newest take ended; empty: nothing.
std::string take_trouble(const RigConfig& config, const HealthInputs& inputs) {
  if (!inputs.takes) return "";
  const TakeReport& takes = *inputs.takes;
  if (!takes.recording) return takes.problem.empty() ? takes.no_disk : takes.problem;
  std::string left_out;
  const auto add = [&](const std::string& what) { left_out += (left_out.empty() ? ": " : ", ") + what; };
  if (takes.quality != 0 && takes.quality < config.takes->quality)
    add(fmt::format("JPEG quality is {} of {}", takes.quality, config.takes->quality));
  if (takes.leaves_out_raymaps) add("raymaps are left out");
  if (inputs.since_lost_set < kLossShown) add(fmt::format("{} sets were lost", takes.lost_sets - takes.lost_by_errors));
  if (!left_out.empty()) left_out = "the disk is too slow for the take" + left_out;
  if (!left_out.empty() && !takes.problem.empty()) return takes.problem + "; " + left_out;
  return left_out.empty() ? takes.problem : left_out;
}

/// How long a thread may be at one piece of work, and what it means if it is longer.
struct Patience {
  std::string_view thread;  ///< begin of its name; empty: any other
  Duration at_most;
  Condition condition = Condition::kThreadSilent;
};
constexpr std::array kPatience{
    Patience{"nodal-takes", kDiskAnswersWithin, Condition::kDiskSilent},
    Patience{"nodal-read", kDiskAnswersWithin, Condition::kDiskSilent},
    Patience{"nodal-record", Supervisor::kStuckAfter, Condition::kStageHangs},
    // A table of many rays takes its time, and so does a card with the store.
    Patience{"nodal-keeper", Duration::seconds(120), Condition::kThreadSilent},
    // Waits for a host; see AnswerThread.
    Patience{"nodal-cable", Duration::seconds(1'000'000'000), Condition::kThreadSilent},
    // A device's call takes some seconds at most: uvcvideo waits 5 s for each control.
    Patience{"", Duration::seconds(15), Condition::kThreadSilent},
};

const Patience& patience_for(const hal::Heartbeat& thread) {
  return *std::find_if(kPatience.begin(), kPatience.end(),
                       [&](const Patience& row) { return thread.name.starts_with(row.thread); });
}

/// The first thread of this condition that is silent; null if there is none.
const hal::Heartbeat* silent_thread(const std::vector<hal::Heartbeat>& threads, Condition condition) {
  const auto silent = std::find_if(threads.begin(), threads.end(), [&](const hal::Heartbeat& thread) {
    const Patience& patience = patience_for(thread);
    return patience.condition == condition && thread.busy > patience.at_most;
  });
  return silent == threads.end() ? nullptr : &*silent;
}

std::string at_one_call(const hal::Heartbeat& thread) {
  return fmt::format("the thread '{}' has been at one call for over {} s", thread.name,
                     patience_for(thread).at_most.ms() / 1000);
}

/// The row of a condition. It holds in every state but kStopping, which is final.
struct Row {
  RigState to;
  Actions actions;
};
constexpr std::array<Row, kConditions> kTable = [] {
  std::array<Row, kConditions> table{};
  constexpr Actions kServe{true, true, false};
  const auto row = [&](Condition when, RigState to, Actions actions) {
    table[static_cast<std::size_t>(when)] = {to, actions};
  };
  row(Condition::kEnding, RigState::kStopping, {false, true, true});
  row(Condition::kStageHangs, RigState::kHanging, {false, false, false});
  row(Condition::kStoreUnread, RigState::kStarting, {false, true, false});
  row(Condition::kNoCalibration, RigState::kNoCalibration, kServe);
  row(Condition::kNoFrames, RigState::kIdle, kServe);
  for (const Condition worse :
       {Condition::kDiskSilent, Condition::kHeadMissing, Condition::kGenlockLost, Condition::kHoldover,
        Condition::kUnfitFrames, Condition::kStoreTrouble, Condition::kHeadTrouble, Condition::kTakeTrouble,
        Condition::kThreadSilent, Condition::kTooSlow}) {
    row(worse, RigState::kDegraded, kServe);
  }
  row(Condition::kHealthy, RigState::kRunning, kServe);
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
  return {row.to, row.actions};
}

std::string undecodable_now(const Blender& blender, std::size_t head) {
  const decode::DecodeFault fault = blender.undecodable(head).now.load(std::memory_order_relaxed);
  return fault == decode::DecodeFault::kNone ? "" : "its pictures " + std::string(decode::decode_fault_text(fault));
}

std::string no_frames(const RigConfig& config, const CaptureReport& capture) {
  std::string why = absent_heads(config, capture);
  if (why.empty()) why = first_head_problem(config, capture);
  for (std::size_t i = 0; why.empty() && i < capture.heads.size(); ++i) {
    if (capture.heads[i].newest_loss) why = without_frames(config, capture, i);
  }
  return "no frames arrive" + (why.empty() ? why : "; " + why);
}

Diagnosis diagnose(const RigConfig& config, const HealthInputs& inputs) {
  const auto found = [](Condition condition, std::string sentence) {
    return Diagnosis{condition, std::move(sentence)};
  };
  if (const auto* stuck = silent_thread(inputs.threads, Condition::kStageHangs)) {
    return found(Condition::kStageHangs, at_one_call(*stuck));
  }
  if (!inputs.keeper.ready) {
    return found(Condition::kStoreUnread,
                 inputs.keeper.activity.empty() ? "reading the calibration store" : inputs.keeper.activity);
  }
  if (!inputs.keeper.in_force) {
    return found(Condition::kNoCalibration,
                 inputs.keeper.problem.empty() ? "no calibration is in force; upload one: nodal calibration upload FILE"
                                               : inputs.keeper.problem);
  }
  std::string absent = absent_heads(config, inputs.capture);
  if (inputs.since_last_set > kSilence.at(inputs.capture.genlock.rate.period())) {
    return found(Condition::kNoFrames, no_frames(config, inputs.capture));
  }
  if (disk_is_silent(inputs.threads)) return found(Condition::kDiskSilent, "the takes' disk does not answer");
  if (!absent.empty()) return found(Condition::kHeadMissing, std::move(absent));
  if (inputs.capture.genlock.state == GenlockState::kLost) {
    return found(Condition::kGenlockLost, "the genlock is lost: heads are no longer exposed together");
  }
  if (inputs.capture.genlock.state == GenlockState::kHoldover) {
    return found(Condition::kHoldover, inputs.capture.genlock.aligned
                                           ? "a head does not carry out its nudges; the heads are still in step"
                                           : "the trigger's pulses are not seen; the heads are still in step");
  }
  if (inputs.unfit_frames > 0) {
    return found(Condition::kUnfitFrames,
                 "the size or format of some frames is not the one that the calibration is for");
  }
  if (!inputs.keeper.problem.empty()) return found(Condition::kStoreTrouble, inputs.keeper.problem);
  if (!inputs.settings_problem.empty()) return found(Condition::kStoreTrouble, inputs.settings_problem);
  if (std::string problem = first_head_problem(config, inputs.capture); !problem.empty()) {
    return found(Condition::kHeadTrouble, std::move(problem));
  }
  if (!inputs.undecodable.empty()) return found(Condition::kHeadTrouble, std::string(inputs.undecodable));
  if (std::string trouble = take_trouble(config, inputs); !trouble.empty())
    return found(Condition::kTakeTrouble, std::move(trouble));
  if (const auto* silent = silent_thread(inputs.threads, Condition::kThreadSilent)) {
    return found(Condition::kThreadSilent, at_one_call(*silent));
  }
  if (std::string slow = too_slow(inputs); !slow.empty()) return found(Condition::kTooSlow, std::move(slow));
  return {};
}

bool disk_is_silent(const std::vector<hal::Heartbeat>& threads) {
  return silent_thread(threads, Condition::kDiskSilent) != nullptr;
}

void Supervisor::end(std::string reason) {
  if (!ending_) ending_ = std::move(reason);
}

void Supervisor::step(const std::vector<Stage>& stages, const Diagnosis& found, Instant now) {
  const std::optional<std::string_view> stuck = find_stuck(stages, now);
  Condition worst = found.condition;
  std::string sentence = found.sentence;
  if (ending_) {
    worst = Condition::kEnding;
    sentence = *ending_;
  } else if (stuck) {
    worst = Condition::kStageHangs;
    sentence = "the " + std::string(*stuck) + " stage has made no progress for 5 s";
    static_assert(kStuckAfter == Duration::seconds(5));
  }
  const Transition next = transition(worst, state_);
  state_ = next.to;
  actions_ = next.actions;
  health_ = {rig_state_name(state_), std::move(sentence)};
  notify(actions_, now);
}

std::optional<std::string_view> Supervisor::find_stuck(const std::vector<Stage>& stages, Instant now) {
  seen_.resize(stages.size(), Seen{0, now});
  std::optional<std::string_view> stuck;
  for (std::size_t i = 0; i < stages.size(); ++i) {
    if (stages[i].may_idle || stages[i].progress != seen_[i].progress) {
      seen_[i] = {stages[i].progress, now};
    } else if (!stuck && now - seen_[i].at > kStuckAfter) {
      stuck = stages[i].name;
    }
  }
  return stuck;
}

void Supervisor::notify(const Actions& actions, Instant now) {
  if (!watchdog_) return;
  if (actions.ready && !ready_sent_) {
    watchdog_->ready();
    ready_sent_ = true;
  }
  if (actions.end && !stopping_sent_) {
    watchdog_->stopping();
    stopping_sent_ = true;
  }
  if (fed_ && now - *fed_ < kFeedEvery) return;
  fed_ = now;
  if (actions.feed) watchdog_->feed();
  std::string line(health_.state);
  if (!health_.problem.empty()) line += ": " + health_.problem;
  if (line == status_sent_) return;
  constexpr std::size_t kLongest = 512;  // bytes
  watchdog_->status(printable(line, kLongest));
  status_sent_ = std::move(line);
}

}  // namespace nodal::firmware
