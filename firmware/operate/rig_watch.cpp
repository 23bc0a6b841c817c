#include "firmware/operate/rig_watch.h"

#include <utility>

namespace nodal::firmware {
namespace {

constexpr Duration kJudgeEvery = Duration::milliseconds(50);
/// After such a pause of the sets, the measured rate does not reflect the board's speed.
constexpr FrameTime kPause{Duration::milliseconds(500), 3};

}  // namespace

RigWatch::RigWatch(const RigConfig& config, const Stages& stages, News& news, hal::WatchdogPort* watchdog, Instant now)
    : config_(config), stages_(stages), news_(news), supervisor_(watchdog), newest_set_(now), unstable_(now) {}

std::uint32_t RigWatch::rate_wanted_millihertz(const CaptureReport& capture) const {
  return millihertz(capture.genlock.rate) * static_cast<std::uint32_t>(config_.raymap.raymaps_a_set());
}

void RigWatch::step(const Input& input, Instant now) {
  if (input.reports.capture->sets != sets_seen_) {
    sets_seen_ = input.reports.capture->sets;
    newest_set_ = now;
  }
  if (input.end_reason) supervisor_.end(*input.end_reason);
  // Who uploads a calibration and then asks for the state must not read that there is none.
  const bool at_once = (input.end_reason && supervisor_.state() != RigState::kStopping) ||
                       input.reports.keeper->in_force != judged_with_;
  if (!judged_ || now - *judged_ >= kJudgeEvery || at_once) assess(input, now);
  watch_seams();
  watch_stability(now);
}

void RigWatch::assess(const Input& input, Instant now) {
  judged_ = now;
  judged_with_ = input.reports.keeper->in_force;
  const std::uint64_t blended = stages_.blender.counts().blended.load(std::memory_order_relaxed);
  rate_.observe(blended, now);
  const std::uint64_t adopted = stages_.blender.counts().adopted.load(std::memory_order_relaxed);
  if (adopted != adopted_ || now - newest_set_ > kPause.at(input.reports.capture->genlock.rate.period()))
    steady_since_ = now;
  adopted_ = adopted;
  shed(input, now);
  const Diagnosis found = diagnosis(input, now);
  const std::string_view before = health().state;
  supervisor_.step({{"capture", stages_.capture.steps(), false},
                    {"blend", stages_.blender.progress(), stages_.blender.idle()},
                    {"encoder", stages_.encoder.steps(), stages_.encoder.steps() == blended}},
                   found, now);
  if (health().state != before) {
    news_.say(NewsKind::kRig, "the state of the rig is now '" + std::string(health().state) + "'" +
                                  (health().problem.empty() ? "" : ": " + health().problem));
  }
  watch_frames(*input.reports.capture, found.condition, now);
}

Diagnosis RigWatch::diagnosis(const Input& input, Instant now) {
  const auto& [capture, keeper, takes] = input.reports;
  std::string undecodable;
  for (std::size_t i = 0; i < config_.heads.size() && undecodable.empty(); ++i) {
    undecodable = undecodable_now(stages_.blender, i);
    if (!undecodable.empty()) undecodable = "head '" + config_.heads[i].name + "': " + undecodable;
  }
  const std::uint64_t lost = takes ? takes->lost_sets - takes->lost_by_errors : 0;
  if (lost > sets_lost_by_disk_) newest_lost_set_ = now;
  sets_lost_by_disk_ = lost;
  const Duration since_lost_set = newest_lost_set_ ? now - *newest_lost_set_ : Duration::seconds(1'000'000);
  if (stages_.heartbeats) stages_.heartbeats->read(threads_);
  watch_disk();
  return diagnose(config_, {*capture, *keeper, rate_wanted_millihertz(*capture), rate_.millihertz(),
                            stages_.blender.counts().unfit_frames.load(std::memory_order_relaxed), now - newest_set_,
                            now - steady_since_, shedding_.level(), input.store_problem, takes, since_lost_set,
                            threads_, undecodable});
}

/// Logs when frames stop and start while no calibration is in force. Otherwise the rig's state reports it.
void RigWatch::watch_frames(const CaptureReport& capture, Condition condition, Instant now) {
  if (condition != Condition::kNoCalibration || supervisor_.state() == RigState::kStopping) return;
  const bool arrive = now - newest_set_ <= kSilence.at(capture.genlock.rate.period());
  if (arrive == frames_arrive_) return;
  frames_arrive_ = arrive;
  news_.say(NewsKind::kRig, arrive ? "frames arrive" : no_frames(config_, capture));
}

/// Logs when the takes' disk stops answering and answers again, whatever else the rig's state reports.
void RigWatch::watch_disk() {
  const bool silent = disk_is_silent(threads_);
  if (std::exchange(disk_silent_, silent) == silent) return;
  news_.say(NewsKind::kRig, silent ? "the takes' disk does not answer" : "the takes' disk answers again");
}

/// Logs the first placed seams that were refused; the status counts them.
void RigWatch::watch_seams() {
  if (seams_refused_told_ || stages_.blender.seams().counts().refused.load(std::memory_order_acquire) == 0) return;
  seams_refused_told_ = true;
  news_.say(NewsKind::kRig, "placed seams were refused, and the old ones stay; the status counts further ones: " +
                                stages_.blender.seams().refused().read());
}

void RigWatch::watch_stability(Instant now) {
  const RigState state = supervisor_.state();
  if (state == RigState::kStarting || state == RigState::kHanging) unstable_ = now;
  if (stable_noted_ || now - unstable_ < kStableAfter) return;
  stable_noted_ = true;
  stages_.settings.note_stable_run();
}

std::uint64_t RigWatch::sets_missed_by_blend(const CaptureReport& capture) {
  for (const OutletReport& outlet : capture.outlets) {
    if (outlet.name == Blender::kSets.name) return outlet.losses.full;
  }
  return 0;  // before the first report
}

void RigWatch::shed(const Input& input, Instant now) {
  const CaptureReport& capture = *input.reports.capture;
  const Duration period = capture.genlock.rate.period();
  shedding_.step(capture.sets, sets_missed_by_blend(capture), now - steady_since_ < kPause.at(period), period, now);
  const ShedLevel& level = shedding_.level();
  stages_.encoder.set_every(input.lossless ? 1 : level.publish_every);
  stages_.blender.set_every(level.preview_every);
}

}  // namespace nodal::firmware
