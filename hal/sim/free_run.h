// When a head exposes by its own clock.
#pragma once

#include <cstdint>

#include "hal/head.h"
#include "hal/sim/crystal.h"
#include "hal/sim/nudge.h"

namespace nodal::hal::sim {

/// Exposures at a rate, by a crystal with a frequency error, shifted by nudges.
///
/// Threading: thread-bound.
/// Ownership: none.
/// Errors: none.
class FreeRun {
 public:
  /// `drift_ppm`: positive is slow.
  FreeRun(FrameRate rate, std::int32_t drift_ppm, const NudgeLimits& limits)
      : rate_(rate), drift_ppb_(std::int64_t{drift_ppm} * 1000), limits_(limits) {}

  /// The stream begins, without nudges; the first exposure is at `first`.
  void start(Instant first) {
    nudges_.restart();
    restart(first);
  }
  /// The next exposure is at `first` and what nudges have added.
  void restart(Instant first) {
    from_ = first;
    next_ = 0;
  }
  /// Begin of the next exposure.
  Instant next() const { return from_ + stretched(rate_.start_of(next_), drift_ppb_) + nudges_.done(); }
  /// It is that of the exposure after it from now on.
  void advance() { ++next_; }
  /// Passes over all exposures that are due but the newest `kept`. Returns how many.
  std::uint64_t skip(Instant now, std::uint64_t kept) {
    const std::uint64_t due = rate_.first_after(unstretched(now - from_ - nudges_.done(), drift_ppb_));
    if (due <= next_ + kept) return 0;
    const std::uint64_t skipped = due - kept - next_;
    next_ += skipped;
    return skipped;
  }

  void nudge(Duration by) { nudges_.ask(by, limits_); }
  /// An exposure that began at `begin` keeps the sensor busy until `busy`: nudges move the next one.
  void move_next(Instant begin, Instant busy) { nudges_.next_period(limits_, begin + rate_.period() - busy); }
  /// Sum of the nudges that were executed.
  Duration nudged() const { return nudges_.done(); }

 private:
  const FrameRate rate_;
  const std::int64_t drift_ppb_;
  const NudgeLimits limits_;
  Instant from_;
  std::uint64_t next_ = 0;
  Nudges nudges_;
};

}  // namespace nodal::hal::sim
