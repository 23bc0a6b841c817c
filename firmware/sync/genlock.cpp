#include "firmware/sync/genlock.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace nodal::firmware {
namespace {

struct Range {
  std::optional<Duration> least, most;
  void add(Duration value) {
    least = std::min(least.value_or(value), value);
    most = std::max(most.value_or(value), value);
  }
  Duration width() const { return least ? *most - *least : Duration(); }
  Duration middle() const { return least ? *least + width() / 2 : Duration(); }
};

}  // namespace

GenlockState genlock_after(GenlockState state, GenlockCondition condition) {
  using enum GenlockState;
  using Row = std::array<GenlockState, 5>;
  constexpr std::array<Row, kGenlockConditions> kTable = {
      Row{kAcquiring, kAcquiring, kAcquiring, kAcquiring, kAcquiring},  // started
      Row{kOff, kOff, kOff, kOff, kOff},                                // stopped
      Row{kOff, kLocked, kLocked, kLocked, kLocked},                    // all heads are locked
      Row{kOff, kAcquiring, kLost, kLost, kLost},                       // out of step
      Row{kOff, kAcquiring, kHoldover, kHoldover, kLost},               // pulse unseen
      Row{kOff, kAcquiring, kHoldover, kHoldover, kLost},               // unresponsive
      Row{kOff, kLost, kHoldover, kHoldover, kLost},                    // pulses overdue
      Row{kOff, kAcquiring, kLost, kLost, kLost},                       // sets overdue
      Row{kOff, kLost, kLost, kLost, kLost},                            // port gone
      Row{kOff, kAcquiring, kLocked, kLost, kLost},                     // coasted long
  };
  return kTable[static_cast<std::size_t>(condition)][static_cast<std::size_t>(state)];
}

std::string_view genlock_condition_name(GenlockCondition condition) {
  constexpr std::array<std::string_view, kGenlockConditions> kNames = {
      "started",      "stopped",        "in step",      "out of step", "pulse unseen",
      "unresponsive", "pulses overdue", "sets overdue", "port gone",   "coasted long"};
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
  beat_.restart(settings_.rate.period());
  pulses_ = {};
  heads_ = {};
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
  add_pulse(**edge);
  return **edge;
}

bool Genlock::pulses_overdue(Instant now) const {
  return !aligned_ && now - newest_edge_ > settings_.rate.period() * 5 / 2;
}

void Genlock::step(Instant now) {
  if (!running() || failed_) return;
  if (pulses_overdue(now)) meet(GenlockCondition::kPulsesOverdue, now);
  // While acquiring, heads may take long to start; after they have followed, missing sets are a loss.
  if (newest_set_ && now - *newest_set_ > settings_.rate.period() * 3) meet(GenlockCondition::kSetsOverdue, now);
  if (state_ == GenlockState::kHoldover && now - coasting_since_ > kHoldover) {
    meet(GenlockCondition::kCoastedLong, now);
  }
}

void Genlock::on_set(const FrameSet& set, const Skews& skews, bool every_present_head, Instant now,
                     HeadMask unresponsive) {
  if (!running() || failed_) return;
  // What step() would have done if it had been called in time: sets may come late, and many at once.
  const Duration since = set.mid_exposure - newest_middle_;
  if (newest_set_ && (since < Duration() || since > settings_.rate.period() * 3))
    meet(GenlockCondition::kSetsOverdue, now);
  newest_set_ = now;
  newest_middle_ = set.mid_exposure;
  if (every_present_head) report_.spread = set.sync.spread;
  if (skews.known != set.mask) {
    return meet(is_as_in_lock(set) ? GenlockCondition::kPulseUnseen : GenlockCondition::kOutOfStep, now);
  }
  if (!follows_pulses(skews, set)) return meet(GenlockCondition::kOutOfStep, now);
  if ((unresponsive & set.mask) != 0) return meet(GenlockCondition::kUnresponsive, now);
  if (pulses_overdue(now)) return meet(GenlockCondition::kPulsesOverdue, now);
  if (++good_sets_ >= kSetsToLock) meet(GenlockCondition::kInStep, now);
  if (state_ != GenlockState::kLocked) return;
  learn(set, skews);
  report_.spread_worst = std::max(report_.spread_worst, set.sync.spread);
}

void Genlock::add_pulse(const hal::TriggerEdge& edge) {
  beat_.add(edge.at);
  const double late_us = beat_.known(edge.at) ? us_of(edge.at - beat_.nearest(edge.at)) : 0;
  pulses_[edge.number % kPulsesKept] = {edge.number, late_us};
}

/// How much later than expected the pulse of this set came.
double Genlock::lateness_us(const FrameSet& set) const {
  if (aligned_ || !set.sync.trigger) return 0;
  const Pulse& pulse = pulses_[*set.sync.trigger % kPulsesKept];
  return pulse.number == *set.sync.trigger ? pulse.late_us : 0;
}

void Genlock::estimate(HeadEstimate& head, double skew_us, Instant at, double pulse_late_us) {
  constexpr double kNoise = clock_spec::kTimestampVarianceUs2;
  const Duration since = at - std::exchange(head.newest, at);
  bool jumped = !head.known || since < Duration() || (aligned_ && since > kHistoryValid.at(settings_.rate.period()));
  if (!jumped) {
    head.skew.predict(seconds_of(aligned_ ? since : std::min(since, kLongestPeriod)), clock_spec::kDriftNoisePpm2PerS);
    const double off = skew_us - head.skew.offset_us();
    jumped = off * off > kSigmas * kSigmas * (head.skew.variance_us2() + kNoise);
    // A head that runs free does not wait for a late pulse, so its skew is smaller by the delay.
    const double off_if_free = off + pulse_late_us;
    const double ratio = (off * off - off_if_free * off_if_free) / (2 * kNoise);
    if (!jumped) head.free_evidence = std::clamp(head.free_evidence + ratio, 0.0, kRunsFree);
  }
  if (jumped) head.skew.restart(skew_us, kNoise, clock_spec::kDriftVariancePpm2);
  else head.skew.update(skew_us, kNoise);
  head.known = true;
}

bool Genlock::estimates_in_step(HeadMask heads, double pulse_late_us) const {
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if ((heads & head_bit(i)) == 0) continue;
    const HeadEstimate& one = heads_[i];
    if (one.free_evidence >= kRunsFree) return false;
    const double one_late = one.free_evidence > kSuspicious ? pulse_late_us : 0;
    for (std::size_t j = 0; j < i; ++j) {
      if ((heads & head_bit(j)) == 0) continue;
      const HeadEstimate& other = heads_[j];
      const double other_late = other.free_evidence > kSuspicious ? pulse_late_us : 0;
      const double apart = one.skew.offset_us() - other.skew.offset_us();
      const double apart_if_free = apart - one_late + other_late;
      const double doubt = kSigmas * std::sqrt(one.skew.variance_us2() + other.skew.variance_us2());
      if (std::max(std::abs(apart), std::abs(apart_if_free)) + doubt > us_of(kSafeLimit)) return false;
    }
  }
  return true;
}

bool Genlock::follows_pulses(const Skews& skews, const FrameSet& set) {
  const double pulse_late_us = lateness_us(set);
  Range raw;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if ((skews.known & head_bit(i)) == 0) continue;
    raw.add(skews.of[i]);
    heads_[i].skew.move(us_of(skews.moved[i]));
    estimate(heads_[i], us_of(skews.of[i]), set.mid_exposure, pulse_late_us);
  }
  if (good_sets_ == 0 && !was_locked_) latency_ = raw.middle();
  return raw.width() <= kSafeLimit && estimates_in_step(skews.known, pulse_late_us) &&
         (aligned_ || abs(raw.middle() - latency_) <= kLockLimit);
}

void Genlock::learn(const FrameSet& set, const Skews& skews) {
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (!set.has(i) || (skews.known & head_bit(i)) == 0) continue;
    const Duration off = set.sync.offset[i] - heads_[i].offset;
    heads_[i].offset = abs(off) > kLockLimit ? set.sync.offset[i] : heads_[i].offset + off / kMean;
  }
}

/// Whether every head has the same position relative to the others as in lock.
bool Genlock::is_as_in_lock(const FrameSet& set) const {
  Range moved;
  for (std::size_t i = 0; i < heads_.size(); ++i) {
    if (!set.has(i)) continue;
    if (!heads_[i].known) return false;
    moved.add(set.sync.offset[i] - heads_[i].offset);
  }
  return moved.width() <= kLockLimit;
}

GenlockReport Genlock::report() const {
  GenlockReport report = report_;
  report.state = state_;
  report.aligned = aligning();
  report.rate = settings_.rate;
  if (port_) report.losses_of_port = port_->counts();
  return report;
}

}  // namespace nodal::firmware
