// When a head's own clock begins exposures, from timestamps with noise.
#pragma once

#include <cstdint>
#include <optional>

#include "firmware/sync/clock_spec.h"
#include "firmware/sync/offset_filter.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// A Kalman filter over phase and rate (OffsetFilter), with the noise that clock_spec.h states. A timestamp 3 standard
/// deviations off its prediction, or before the last, is an outlier; three of them in a row are a new phase, as is the
/// first after a long gap. A head that is started anew has another phase and its old crystal: the rate stays.
///
/// Threading: thread-bound.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class PhaseLine {
 public:
  void restart(Duration period);
  void restart_phase() { moments_ = outliers_ = 0; }
  void add(Instant begin);

  /// Two moments at least, of late enough to go by.
  bool known(Instant now) const;
  /// Of the moments on the line, the one that is nearest.
  Instant nearest(Instant at) const;
  /// Mean distance of a moment from the line.
  Duration jitter() const { return jitter_; }
  /// Positive is slow, in 1/1000 ppm; nothing before kMomentsForRate.
  std::optional<std::int32_t> drift_ppb() const;

  /// A line through 64 timestamps at 30 a second has a rate to 115 us x sqrt(12 / 64^3) / 33 ms = 23 ppm.
  static constexpr std::int64_t kMomentsForRate = 64;
  /// Until it is measured: the mean of a uniform error of up to kTimestampErrorUs is half of it.
  static constexpr Duration kJitterAtFirst =
      Duration::microseconds(static_cast<std::int64_t>(clock_spec::kTimestampErrorUs / 2));

 private:
  Duration period_;
  Instant begin_;             ///< on the line
  OffsetFilter line_;         ///< offset after begin_; drift of the periods
  std::int64_t moments_ = 0;  ///< of this phase
  std::int64_t of_rate_ = 0;  ///< moments that went into the rate
  int outliers_ = 0;          ///< in a row
  Duration jitter_ = kJitterAtFirst;
};

}  // namespace nodal::firmware
