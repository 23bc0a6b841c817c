#include "firmware/capture/set_timing.h"

#include <algorithm>
#include <span>

#include "firmware/frame/statistics.h"

namespace nodal::firmware {
namespace {

Duration spread_of(const Skews& skews) {
  std::optional<Duration> earliest, latest;
  for (std::size_t i = 0; i < skews.of.size(); ++i) {
    if ((skews.known & head_bit(i)) == 0) continue;
    earliest = std::min(earliest.value_or(skews.of[i]), skews.of[i]);
    latest = std::max(latest.value_or(skews.of[i]), skews.of[i]);
  }
  return earliest ? *latest - *earliest : Duration();
}

}  // namespace

SetTiming::SetTiming(const RigConfig& config) : rate_(config.rate), clock_(config.rate) {
  for (std::size_t i = 0; i < config.heads.size(); ++i)
    wiring_[i] = {config.heads[i].wired, config.heads[i].trigger_delay};
}

void SetTiming::restart(FrameRate rate, bool genlocked, Instant now) {
  clock_.restart(rate, genlocked, now);
  set_rate_.restart(rate);
  pulse_drift_.restart(rate);
  for (DriftMeter& drift : head_drift_) drift.restart(rate);
  for (PulseWatch& watch : pulse_watch_) watch.restart(rate);
}

void SetTiming::on_edge(const hal::TriggerEdge& edge) {
  clock_.on_edge(edge);
  pulse_drift_.add(static_cast<std::int64_t>(edge.number), edge.at);
}

std::optional<SetClock::Match> SetTiming::match(std::size_t head, const hal::FrameView& frame) {
  return clock_.match(head, frame.mid_exposure, frame.in_effect.exposure, wiring_[head].delay);
}

void SetTiming::add_pulsed(std::size_t head, const SetClock::Match& match, const hal::FrameView& frame) {
  if (wiring_[head].wired) pulse_watch_[head].add(*match.trigger, match.skew, frame.sequence);
}

void SetTiming::add_free(std::size_t head, const SetClock::Match& match, const hal::FrameView& frame) {
  head_drift_[head].add(match.slot, frame.mid_exposure);
}

std::optional<std::int32_t> SetTiming::drift_ppb(bool pulsed) const {
  if (pulsed) return pulse_drift_.ppb();
  std::array<std::int32_t, kMaxHeads> drifts{};
  std::size_t known = 0;
  for (const DriftMeter& head : head_drift_) {
    if (const auto drift = head.ppb()) drifts[known++] = *drift;
  }
  if (known == 0) return std::nullopt;
  return median(std::span(drifts).first(known));
}

void SetTiming::describe(FrameSet& set, const Skews& skews, bool pulsed) {
  std::array<Instant, kMaxHeads> middles;
  std::size_t count = 0;
  for (std::size_t i = 0; i < middles.size(); ++i) {
    if (set.has(i)) middles[count++] = set.frames[i].mid_exposure;
  }
  NODAL_ASSERT(count > 0);
  std::sort(middles.begin(), middles.begin() + static_cast<std::ptrdiff_t>(count));
  set.mid_exposure = middles[count / 2];
  set.second_field = rate_.period() / 2;  // rig.toml's rate, because the head's own rate separates its two fields
  set.sync.spread = middles[count - 1] - middles[0];
  for (std::size_t i = 0; i < middles.size(); ++i) {
    set.sync.offset[i] = set.has(i) ? set.frames[i].mid_exposure - set.mid_exposure : Duration();
  }
  if (skews.known == set.mask) set.sync.begin_spread = spread_of(skews);
  set.sync.drift_ppb = drift_ppb(pulsed);
  set_rate_.add(set.mid_exposure, set.sync.drift_ppb);
  set.rate = set_rate_.rate();
}

void SetTiming::report_wired(GenlockReport& report) const {
  for (std::size_t i = 0; i < wiring_.size(); ++i) {
    if (wiring_[i].wired) report.wired[i] = {pulse_watch_[i].state(), pulse_watch_[i].drift_ppb()};
  }
}

}  // namespace nodal::firmware
