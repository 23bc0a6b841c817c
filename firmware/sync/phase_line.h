// Estimates when a head's own clock begins exposures, from noisy timestamps.
#pragma once

#include <cstdint>
#include <optional>

#include "firmware/sync/clock_spec.h"
#include "firmware/sync/offset_filter.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// A Kalman filter over phase and rate (OffsetFilter) with the noise of clock_spec.h. A timestamp is an outlier if it
/// is 3 standard deviations away from its prediction, or earlier than the previous one. Three outliers in a row start a
/// new phase; so does the first timestamp after a long gap. A head that is restarted has a new phase and the same
/// crystal, so the estimate of the rate is kept.
///
/// Threading: thread-bound.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class PhaseLine {
 public:
  void restart(Duration period);
  void restart_phase() { moments_ = outliers_ = 0; }
  void add(Instant begin);

  /// There are at least two recent timestamps.
  bool known(Instant now) const;
  /// The time nearest to the argument at which an exposure begins.
  Instant nearest(Instant at) const;
  /// Mean distance of the timestamps from their predictions.
  Duration jitter() const { return jitter_; }
  /// In 1/1000 ppm; positive: slower than nominal. Nothing before kMomentsForRate timestamps.
  std::optional<std::int32_t> drift_ppb() const;

  /// 64 timestamps at 30 per second give the rate with an error of 115 us x sqrt(12 / 64^3) / 33 ms = 23 ppm.
  static constexpr std::int64_t kMomentsForRate = 64;
  /// Assumed until it is measured: the mean absolute value of a uniform error of up to kTimestampErrorUs.
  static constexpr Duration kJitterAtFirst =
      Duration::microseconds(static_cast<std::int64_t>(clock_spec::kTimestampErrorUs / 2));

 private:
  Duration period_;
  Instant begin_;             ///< smoothed begin of the newest period
  OffsetFilter line_;         ///< offset after begin_; drift of the periods
  std::int64_t moments_ = 0;  ///< timestamps added since the phase was last set
  std::int64_t of_rate_ = 0;  ///< timestamps that the rate was estimated from
  int outliers_ = 0;          ///< outliers in a row
  Duration jitter_ = kJitterAtFirst;
};

}  // namespace nodal::firmware
