#include "firmware/sync/genlock.h"

#include <algorithm>

namespace nodal::firmware {
namespace {

Duration size_of(Duration d) { return d < Duration() ? -d : d; }

struct Range {
  std::optional<Duration> least, most;
  void add(Duration value) {
    least = std::min(least.value_or(value), value);
    most = std::max(most.value_or(value), value);
  }
  Duration width() const { return least ? *most - *least : Duration(); }
  Duration middle() const { return least ? *least + width() / 2 : Duration(); }
};

/// What the heads' jitter says of them together.
class Noise {
 public:
  void add(Duration jitter, bool of_whole_past) {
    if (of_whole_past) all_[count_++] = jitter;
    else unsure_ = std::max(unsure_, jitter);
  }
  /// From here on they are known.
  void sort() { std::sort(all_.begin(), all_.begin() + static_cast<std::ptrdiff_t>(count_)); }

  /// What to expect of any of them: of many alike one seems to jitter more than it does, and their mean tells better.
  Duration jitter() const {
    if (count_ == 0) return unsure_ * 9 / 10;
    const Duration loudest = most() * 9 / 10;
    Duration sum;
    for (std::size_t i = 0; i < count_; ++i) sum = sum + all_[i];
    const Duration mean = std::min(loudest, sum / static_cast<std::int64_t>(count_));
    return std::max(mean + (loudest - mean) * unlike() / kWhole, unsure_ * 9 / 10);
  }
  /// How far stamps are off where exposures are, too: which one head tells that jitters more than twice as much as most.
  Duration of_stamps(Duration at_first) const {
    if (count_ == 0 || most() <= at_first || most() <= median() * 2) return {};
    return median();
  }

 private:
  static constexpr std::size_t kMany = 8;
  static constexpr std::int64_t kWhole = 16;

  /// 0: they jitter alike; kWhole: one does otherwise, or they are too few to tell. By chance one of sixteen seems to
  /// jitter 1.4 times as much as most, and little by little more: what that leaves of the room must not come all at once.
  std::int64_t unlike() const {
    if (count_ < kMany || most() * 5 > median() * 8) return kWhole;
    const Duration beyond = most() * 5 - median() * 7;
    return beyond <= Duration() ? 0 : beyond.ns() * kWhole / median().ns();
  }
  Duration most() const { return all_[count_ - 1]; }
  Duration median() const { return all_[(count_ - 1) / 2]; }

  std::array<Duration, kMaxHeads> all_{};
  std::size_t count_ = 0;
  Duration unsure_;
};

}  // namespace

GenlockState genlock_after(GenlockState state, GenlockCondition condition) {
  using enum GenlockState;
  using Row = std::array<GenlockState, 5>;
  constexpr std::array<Row, kGenlockConditions> kTable = {
      Row{kAcquiring, kAcquiring, kAcquiring, kAcquiring, kAcquiring},  // started
      Row{kOff, kOff, kOff, kOff, kOff},                                // stopped
      Row{kOff, kLocked, kLocked, kLocked, kLocked},                    // in step
      Row{kOff, kAcquiring, kLost, kLost, kLost},                       // out of step
      Row{kOff, kAcquiring, kHoldover, kHoldover, kLost},               // pulse unseen
      Row{kOff, kAcquiring, kHoldover, kHoldover, kLost},               // unheeded
      Row{kOff, kLost, kHoldover, kHoldover, kLost},                    // pulses overdue
      Row{kOff, kAcquiring, kLost, kLost, kLost},                       // sets overdue
      Row{kOff, kLost, kLost, kLost, kLost},                            // port gone
      Row{kOff, kAcquiring, kLocked, kLost, kLost},                     // coasted long
  };
  return kTable[static_cast<std::size_t>(condition)][static_cast<std::size_t>(state)];
}

std::string_view genlock_condition_name(GenlockCondition condition) {
  constexpr std::array<std::string_view, kGenlockConditions> kNames = {
      "started",  "stopped",        "in step",      "out of step", "pulse unseen",
      "unheeded", "pulses overdue", "sets overdue", "port gone",   "coasted long"};
  return kNames[static_cast<std::size_t>(condition)];
}

void Genlock::meet(GenlockCondition condition, Instant now) {
  const GenlockState after = genlock_after(state_, condition);
  if (condition != GenlockCondition::kInStep) good_sets_ = 0;
  if (after == state_) return;
  state_ = after;
  if (after == GenlockState::kLost) ++report_.losses;
  if (after == GenlockState::kLocked) was_locked_ = true;
  if (after == GenlockState::kHoldover) {
    ++report_.holdovers;
    coasting_since_ = now;
  }
}

Status Genlock::start(const hal::TriggerSettings& settings, Instant now) {
  if (!port_) return fail(Errc::kNoSuchDevice, "this rig has no trigger, so its heads cannot be genlocked");
  port_->stop();
  if (Status started = port_->start(settings); !started) {
    meet(GenlockCondition::kStopped, now);
    return fail(started.error().in("trigger"));
  }
  settings_ = settings;
  aligned_ = false;
  begin(now);
  return {};
}

void Genlock::align(FrameRate rate, Instant now) {
  if (port_) port_->stop();
  settings_ = {};
  settings_.rate = rate;
  aligned_ = true;
  begin(now);
}

void Genlock::begin(Instant now) {
  failed_ = was_locked_ = false;
  newest_edge_ = now;
  newest_set_.reset();
  next_number_ = 0;
  habits_ = {};
  report_ = {};
  meet(GenlockCondition::kStarted, now);
}

void Genlock::stop() {
  if (port_) port_->stop();
  meet(GenlockCondition::kStopped, Instant());
}

std::optional<hal::TriggerEdge> Genlock::take_edge(Instant now) {
  if (!running() || failed_ || aligned_) return std::nullopt;
  auto edge = port_->take_edge();
  if (!edge) {
    failed_ = true;
    meet(GenlockCondition::kPortGone, now);
    return std::nullopt;
  }
  if (!*edge) return std::nullopt;
  newest_edge_ = std::max(newest_edge_, (*edge)->at);
  ++report_.triggers;
  report_.missing += (*edge)->number - std::min((*edge)->number, next_number_);
  next_number_ = (*edge)->number + 1;
  return **edge;
}

bool Genlock::pulses_overdue(Instant now) const {
  return !aligned_ && now - newest_edge_ > settings_.rate.period() * 5 / 2;
}

void Genlock::step(Instant now) {
  if (!running() || failed_) return;
  if (pulses_overdue(now)) meet(GenlockCondition::kPulsesOverdue, now);
  // Acquiring, heads may take long to start; once they followed, silence is a loss.
  if (newest_set_ && now - *newest_set_ > settings_.rate.period() * 3) meet(GenlockCondition::kSetsOverdue, now);
  if (state_ == GenlockState::kHoldover && now - coasting_since_ > kHoldover) {
    meet(GenlockCondition::kCoastedLong, now);
  }
}

void Genlock::on_set(const FrameSet& set, const Skews& skews, bool every_present_head, Instant now,
                     HeadMask unheeding) {
  if (!running() || failed_) return;
  // As step() would have found, had it been called: sets may come late, many at once.
  const Duration since = set.mid_exposure - newest_middle_;
  if (newest_set_ && (since < Duration() || since > settings_.rate.period() * 3))
    meet(GenlockCondition::kSetsOverdue, now);
  newest_set_ = now;
  newest_middle_ = set.mid_exposure;
  if (every_present_head) report_.spread = set.sync.spread;
  if (skews.known != set.mask) {
    return meet(is_as_in_lock(set) ? GenlockCondition::kPulseUnseen : GenlockCondition::kOutOfStep, now);
  }
  if (!follows_pulses(skews, set.mid_exposure)) return meet(GenlockCondition::kOutOfStep, now);
  if ((unheeding & set.mask) != 0) return meet(GenlockCondition::kUnheeded, now);
  if (pulses_overdue(now)) return meet(GenlockCondition::kPulsesOverdue, now);
  if (++good_sets_ >= kSetsToLock) meet(GenlockCondition::kInStep, now);
  if (state_ != GenlockState::kLocked) return;
  learn(set, skews);
  report_.spread_worst = std::max(report_.spread_worst, set.sync.spread);
}

bool Genlock::follows_pulses(const Skews& skews, Instant at) {
  Range raw, smooth;
  Noise noise;
  std::int64_t least_known = kMean;
  for (std::size_t i = 0; i < habits_.size(); ++i) {
    if ((skews.known & head_bit(i)) == 0) continue;
    raw.add(skews.of[i]);
    Habit& habit = habits_[i];
    habit.mean = habit.mean + skews.moved[i];
    habit.mean_of_means = habit.mean_of_means + skews.moved[i];
    if (aligned_ && size_of(at - habit.newest) > kPastHolds) habit.skews = 0;
    habit.newest = at;
    const Duration off = skews.of[i] - habit.skew();
    // A leap is not jitter: the head was started anew, or lost its trigger, or has it back.
    if (habit.skews == 0 || size_of(off) > std::min(kLockLimit, habit.jitter * 4 + kJitterAtFirst)) {
      habit.mean = habit.mean_of_means = skews.of[i];
      habit.skews = 1;
      habit.jitter = kJitterAtFirst;
      habit.lean = {};
    } else {
      habit.skews = std::min(habit.skews + 1, kMean);
      habit.mean = habit.mean + (skews.of[i] - habit.mean) / habit.skews;
      habit.mean_of_means = habit.mean_of_means + (habit.mean - habit.mean_of_means) / habit.skews;
      // A short past is off itself, and a head that comes back a little elsewhere is far off to one side for a while: no
      // jitter, as far as it leans more than jitter alone lets it.
      const Duration way = habit.lean - std::clamp(habit.lean, -habit.jitter, habit.jitter);
      const Duration seen = std::min(size_of(off - way), habit.jitter * 2 + kStampDoubt);
      if (habit.skews == kMean) habit.jitter = habit.jitter + (seen - habit.jitter) / kMean;
      habit.lean = habit.lean + (off - habit.lean) / 4;
    }
    least_known = std::min(least_known, habit.skews);
    noise.add(habit.jitter, habit.skews == kMean);
    smooth.add(habit.skew());
  }
  if (good_sets_ == 0 && !was_locked_) latency_ = raw.middle();
  // The next set is off by twice the mean distance; what a whole past says, by half of it, and a short one by twice as
  // much again.
  noise.sort();
  // A head that comes back from elsewhere seems to jitter for as long as its past lasts.
  const Duration doubt = good_sets_ < kMean ? Duration() : noise.of_stamps(kJitterAtFirst) * 2;
  const Duration room = kLockLimit - doubt - noise.jitter() * (9 * kMean - 4 * least_known) / (2 * kMean);
  return raw.width() <= kLockLimit - kStampDoubt - doubt && smooth.width() <= room &&
         (aligned_ || size_of(raw.middle() - latency_) <= kLockLimit);
}

void Genlock::learn(const FrameSet& set, const Skews& skews) {
  for (std::size_t i = 0; i < habits_.size(); ++i) {
    if (!set.has(i) || (skews.known & head_bit(i)) == 0) continue;
    const Duration off = set.sync.offset[i] - habits_[i].offset;
    habits_[i].offset = size_of(off) > kLockLimit ? set.sync.offset[i] : habits_[i].offset + off / kMean;
  }
}

/// Every head is where it was against the others.
bool Genlock::is_as_in_lock(const FrameSet& set) const {
  Range moved;
  for (std::size_t i = 0; i < habits_.size(); ++i) {
    if (!set.has(i)) continue;
    if (habits_[i].skews == 0) return false;
    moved.add(set.sync.offset[i] - habits_[i].offset);
  }
  return moved.width() <= kLockLimit;
}

GenlockReport Genlock::report() const {
  GenlockReport report = report_;
  report.state = state_;
  report.aligned = aligning();
  report.rate = settings_.rate;
  return report;
}

}  // namespace nodal::firmware
