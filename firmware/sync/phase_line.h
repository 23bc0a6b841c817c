// When a head's own clock begins exposures, from stamps that jitter.
#pragma once

#include <cstdint>
#include <optional>

#include "protocol/base/units.h"

namespace nodal::firmware {

/// A straight line through the moments that came, by least squares whose memory grows to kMemory of them: a phase and a
/// rate. A moment far off the line, or before the last, is not believed, and three of them in a row are a new phase, as is
/// the first after a long gap. A head that is started anew has another phase and its old crystal: the rate stays.
///
/// Threading: thread-bound.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class PhaseLine {
 public:
  void restart(Duration period);
  void restart_phase() { moments_ = doubted_ = 0; }
  void add(Instant begin);

  /// Two moments at least, of late enough to go by.
  bool known(Instant now) const;
  /// Of the moments on the line, the one that is nearest.
  Instant nearest(Instant at) const;
  /// Mean distance of a moment from the line.
  Duration jitter() const { return jitter_; }
  /// Positive is slow, in 1/1000 ppm; nothing before kMomentsForRate.
  std::optional<std::int32_t> drift_ppb() const;

  static constexpr std::int64_t kMemory = 512;
  static constexpr std::int64_t kMomentsForRate = 64;
  static constexpr Duration kLeap = Duration::milliseconds(2);
  static constexpr Duration kJitterAtFirst = Duration::microseconds(100);

 private:
  std::int64_t drift_over(std::int64_t periods) const { return rate_ * periods / kRateOne; }

  static constexpr std::int64_t kRateOne = 1 << 16;

  Duration period_;
  Instant begin_;             ///< on the line
  std::int64_t rate_ = 0;     ///< how much longer its periods are than period_, ns / kRateOne
  std::int64_t moments_ = 0;  ///< of this phase, up to kMemory
  std::int64_t of_rate_ = 0;  ///< moments that went into the rate, up to kMemory
  int doubted_ = 0;
  Duration jitter_ = kJitterAtFirst;
};

}  // namespace nodal::firmware
