#include "firmware/sync/phase_line.h"

#include <algorithm>

namespace nodal::firmware {
namespace {

constexpr int kOutliers = 3;       ///< one or two are single wrong timestamps; with a new phase, all are
constexpr double kSigmas = 3;      ///< standard deviations that count as certain
constexpr std::int64_t kGap = 16;  ///< periods without a timestamp after which the phase is not known
/// The mean of this many uniform errors has an error of 0.58 / sqrt(63) = 7 %.
constexpr std::int64_t kJitterMemory = 32;
constexpr double kTimestampNoise = clock_spec::kTimestampVarianceUs2;

Duration from_us(double us) { return Duration::nanoseconds(static_cast<std::int64_t>(us * 1000)); }

std::int64_t nearest_multiple(Duration d, Duration of) {
  const std::int64_t shifted = (d + of / 2).ns();
  return shifted / of.ns() - (shifted % of.ns() < 0 ? 1 : 0);
}

}  // namespace

void PhaseLine::restart(Duration period) {
  *this = {};
  period_ = period;
  line_.restart(0, kTimestampNoise, clock_spec::kDriftVariancePpm2);
}

void PhaseLine::add(Instant begin) {
  if (moments_ == 0) {
    begin_ = begin;
    line_.restart_offset(0, kTimestampNoise);
    moments_ = 1;
    of_rate_ += 1;
    return;
  }
  const std::int64_t periods = nearest_multiple(begin - begin_, period_);
  if (periods == 0) return;  // the same timestamp again
  if (periods > kGap) {      // meanwhile a clock may have been set by a small amount
    restart_phase();
    return add(begin);
  }
  const Instant nominal = begin_ + period_ * periods;
  OffsetFilter line = line_;
  if (periods > 0) line.predict(seconds_of(period_ * periods), clock_spec::kWanderPpm2PerS);
  const double measured = us_of(begin - nominal);
  const double off = measured - line.offset_us();
  if (periods < 0 || off * off > kSigmas * kSigmas * (line.variance_us2() + kTimestampNoise)) {
    if (++outliers_ < kOutliers) return;  // earlier than the last one: a clock was set back
    restart_phase();
    return add(begin);
  }
  outliers_ = 0;
  ++moments_;
  ++of_rate_;
  line.update(measured, kTimestampNoise);
  const Duration offset = from_us(line.offset_us());
  begin_ = nominal + offset;
  line.move(-us_of(offset));
  line_ = line;
  const Duration size = from_us(off < 0 ? -off : off);
  jitter_ = jitter_ + (size - jitter_) / kJitterMemory;
}

bool PhaseLine::known(Instant now) const { return moments_ >= 2 && now - begin_ < period_ * kGap; }

Instant PhaseLine::nearest(Instant at) const {
  const std::int64_t periods = nearest_multiple(at - begin_, period_);
  const Duration nominal = period_ * periods;
  return begin_ + nominal + from_us(line_.offset_us() + line_.drift_ppm() * seconds_of(nominal));
}

std::optional<std::int32_t> PhaseLine::drift_ppb() const {
  if (of_rate_ < kMomentsForRate) return std::nullopt;
  constexpr double kMax = 1e9;
  return static_cast<std::int32_t>(std::clamp(line_.drift_ppm() * 1000, -kMax, kMax));
}

}  // namespace nodal::firmware
