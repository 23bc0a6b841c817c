#include "firmware/sync/phase_line.h"

#include <algorithm>

namespace nodal::firmware {
namespace {

constexpr int kDoubts = 3;
constexpr std::int64_t kGap = 16;  ///< periods without a moment after which the phase is not known

std::int64_t nearest_multiple(Duration d, Duration of) {
  const std::int64_t shifted = (d + of / 2).ns();
  return shifted / of.ns() - (shifted % of.ns() < 0 ? 1 : 0);
}

}  // namespace

void PhaseLine::restart(Duration period) {
  *this = {};
  period_ = period;
}

void PhaseLine::add(Instant begin) {
  if (moments_ == 0) {
    begin_ = begin;
    moments_ = 1;
    of_rate_ = std::max<std::int64_t>(of_rate_, 1);
    return;
  }
  const std::int64_t periods = nearest_multiple(begin - begin_, period_);
  if (periods == 0) return;  // the same once more
  if (periods > kGap) {      // a clock may have been set meanwhile by less than a leap
    restart_phase();
    return add(begin);
  }
  const Instant expected = begin_ + period_ * periods + Duration::nanoseconds(drift_over(periods));
  const Duration off = begin - expected;
  if (periods < 0 || off > kLeap || off < -kLeap) {  // before the last: a clock was set back
    if (++doubted_ < kDoubts) return;
    restart_phase();
    return add(begin);
  }
  doubted_ = 0;
  const std::int64_t n = moments_ = std::min(moments_ + 1, kMemory);
  const std::int64_t m = of_rate_ = std::min(of_rate_ + 1, kMemory);
  // Least squares where phase and rate are both new; where the rate is known, the phase is a mean.
  const bool rate_known = m > n && m >= kMomentsForRate;
  begin_ = expected + (rate_known ? off / std::min(n, kMemory / 4) : off * (2 * (2 * n - 1)) / (n * (n + 1)));
  rate_ += off.ns() * kRateOne * 6 / (m * (m + 1)) / periods;
  const Duration size = off < Duration() ? -off : off;
  jitter_ = jitter_ + (size - jitter_) / 32;
}

bool PhaseLine::known(Instant now) const { return moments_ >= 2 && now - begin_ < period_ * kGap; }

Instant PhaseLine::nearest(Instant at) const {
  const std::int64_t periods = nearest_multiple(at - begin_, period_);
  return begin_ + period_ * periods + Duration::nanoseconds(drift_over(periods));
}

std::optional<std::int32_t> PhaseLine::drift_ppb() const {
  if (of_rate_ < kMomentsForRate) return std::nullopt;
  constexpr std::int64_t kBillion = 1'000'000'000;
  const std::int64_t ppb = rate_ * (kBillion / kRateOne) / period_.ns();
  return static_cast<std::int32_t>(std::clamp(ppb, -kBillion, kBillion));
}

}  // namespace nodal::firmware
