#include "firmware/sync/pulse_watch.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "firmware/sync/clock_spec.h"

namespace nodal::firmware {

void PulseWatch::restart(FrameRate rate) {
  *this = {};
  rate_ = rate;
  drift_.restart(rate);
}

void PulseWatch::add(std::uint64_t pulse, Duration skew, std::uint32_t sequence) {
  if (last_ && pulse <= last_->pulse) return;  // duplicates
  const Duration period = rate_.period();
  if (last_) {
    Duration change = skew - last_->skew;
    if (change > period / 2) change = change - period;
    if (change < -(period / 2)) change = change + period;
    delay_ = delay_ + change;
    const bool jumped = abs(change) > kJump;
    since_jump_ = jumped ? 0 : std::min(since_jump_ + 1, kCalm);
    jumps_ = since_jump_ == kCalm ? 0 : std::min(jumps_ + (jumped ? 1 : 0), kFewJumps + 1);
    const bool pause = pulse - last_->pulse > static_cast<std::uint64_t>(DriftMeter::kBlockPeriods);
    if (pause || (jumped && jumps_ <= kFewJumps)) measure_again();
    const bool skips = sequence == last_->sequence + 1 && pulse > last_->pulse + 1;
    skips_ = skips ? std::min(skips_ + 1, kSkipsToReport) : 0;
  }
  last_ = Exposure{pulse, skew, sequence};
  ++exposures_;
  // The delay is what the pulses' nominal grid is shifted by, so the meter's result is the drift relative to the
  // pulses.
  drift_.add(static_cast<std::int64_t>(pulse), Instant() + rate_.start_of(pulse) + delay_);
}

void PulseWatch::measure_again() {
  drift_.restart(rate_);
  exposures_ = 0;
}

/// The smallest drift that is not an effect of timestamp errors: kSigmas standard deviations of the difference between
/// the mean delays of two halves, divided by their distance in time.
double PulseWatch::least_drift_ppb() const {
  constexpr auto kBlock = static_cast<double>(DriftMeter::kBlockPeriods);
  // Variance of a delay, which is the difference of two timestamps.
  constexpr double kVarianceUs2 = 2 * clock_spec::kTimestampVarianceUs2;
  const auto blocks = std::clamp<std::int64_t>(exposures_ / DriftMeter::kBlockPeriods, 2,
                                               static_cast<std::int64_t>(DriftMeter::kBlocks));
  const auto half = static_cast<double>(blocks / 2);
  const auto apart = static_cast<double>(blocks - blocks / 2);
  const double moved_us = kSigmas * std::sqrt(2 * kVarianceUs2 / (half * kBlock));
  return moved_us * 1e12 / (apart * kBlock * static_cast<double>(rate_.period().ns()));
}

Following PulseWatch::state() const {
  if (skips_ >= kSkipsToReport) return Following::kSkipsPulses;
  const auto drift = drift_.ppb();
  if (!drift) return Following::kUnknown;
  return std::abs(static_cast<double>(*drift)) > least_drift_ppb() ? Following::kDrifts : Following::kFollows;
}

}  // namespace nodal::firmware
