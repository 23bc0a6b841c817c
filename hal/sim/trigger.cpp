#include "hal/sim/trigger.h"

#include <fmt/format.h>

#include "hal/sim/crystal.h"
#include "protocol/base/limits.h"
#include "protocol/base/try.h"

namespace nodal::hal::sim {

SimTrigger::SimTrigger(ClockPort& clock, const TriggerOptions& options, std::uint64_t seed)
    : clock_(clock), options_(options), random_(seed, "trigger") {}

Status SimTrigger::check_present() const {
  if (safe_.load()) return fail(Errc::kDeviceGone, "trigger 'sim': its line is safe for good; the program ends");
  if (gone_) return fail(Errc::kDeviceGone, "trigger 'sim': unplugged; restart nodald when it is back");
  return {};
}

Status SimTrigger::check(const TriggerSettings& settings) const {
  NODAL_TRY(check_present());
  if (!settings.rate.valid() || settings.rate.period() < options_.fastest.period()) {
    return fail(Errc::kBadValue,
                fmt::format("trigger 'sim': a rate of {}/{} cannot be made; allowed is {}, and here at most {}/{}",
                            settings.rate.numerator, settings.rate.denominator, kFrameRatesAllowed,
                            options_.fastest.numerator, options_.fastest.denominator));
  }
  const Duration period = settings.rate.period();
  if (settings.pulse_width.ns() <= 0 || settings.pulse_width >= period) {
    return fail(Errc::kBadValue, fmt::format("trigger 'sim': a pulse of {} us does not fit a period of {} us",
                                             settings.pulse_width.us(), period.us()));
  }
  for (std::size_t head = 0; head < settings.delay.size(); ++head) {
    if (settings.delay[head].ns() < 0 || settings.delay[head] >= period) {
      return fail(Errc::kBadValue,
                  fmt::format("trigger 'sim': the delay of head {} is not between 0 and the period of {} us", head,
                              period.us()));
    }
  }
  if (settings.follow && !options_.external) {
    return fail(Errc::kUnsupported, "trigger 'sim': nobody drives its input; drive it, or connect what does");
  }
  return {};
}

Status SimTrigger::start(const TriggerSettings& settings) {
  NODAL_TRY(check(settings));
  stop();
  settings_ = settings;
  running_ = true;
  rate_ = settings.follow ? *options_.external : settings.rate;
  started_ = clock_.now() + options_.first_pulse;
  if (settings.follow) {
    // Pulse 0 is the next pulse of a train that began before start().
    const std::int64_t period = rate_.period().ns();
    started_ = Instant::from_ns((started_.ns() + period - 1) / period * period);
  }
  next_ = 0;
  next_at_ = planned(0);
  edges_.clear();
  return {};
}

void SimTrigger::stop() {
  if (gone_ || !running_) return;
  step(clock_.now());
  running_ = false;
}

Result<std::optional<TriggerEdge>> SimTrigger::take_edge() {
  NODAL_TRY(check_present());
  step(clock_.now());
  if (edges_.empty()) return std::optional<TriggerEdge>{};
  const TriggerEdge edge = edges_.front();
  edges_.pop_front();
  return std::optional<TriggerEdge>{edge};
}

void SimTrigger::step(Instant now) {
  if (gone_ || !running_) return;
  for (std::size_t done = 0; next_at_ <= now && !safe_.load(); ++done) {
    if (done == kEdgesKept) skip_to(now);
    const std::uint64_t number = next_;
    const Instant at = next_at_;
    ++next_;
    next_at_ = planned(next_) + random_.around_zero(options_.jitter);
    if (pulses_to_lose_ > 0) {
      --pulses_to_lose_;
      continue;
    }
    send(number, at);
  }
}

/// After a long pause only the oldest and the newest kEdgesKept pulses are sent one by one, to bound a step's time.
void SimTrigger::skip_to(Instant now) {
  const std::uint64_t due = rate_.first_after(unstretched(now - started_, options_.drift_ppb));
  if (due <= next_ + kEdgesKept) return;
  const std::uint64_t unseen = due - kEdgesKept - next_;
  forgotten_ += unseen;
  sent_ += unseen;
  next_ += unseen;
  next_at_ = planned(next_);
  for (PulseSink* sink : sinks_) {
    if (sink != nullptr) sink->on_unseen(unseen);
  }
}

Instant SimTrigger::planned(std::uint64_t number) const {
  return started_ + stretched(rate_.start_of(number), options_.drift_ppb);
}

void SimTrigger::send(std::uint64_t number, Instant at) {
  ++sent_;
  if (edges_.size() == kEdgesKept) {
    edges_.pop_front();
    ++forgotten_;
  }
  edges_.push_back({number, at});
  for (std::size_t head = 0; head < sinks_.size(); ++head) {
    if (sinks_[head] != nullptr) sinks_[head]->on_pulse(number, at + settings_.delay[head]);
  }
}

}  // namespace nodal::hal::sim
