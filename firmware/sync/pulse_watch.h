// Whether a head that is wired to the trigger's line follows its pulses.
#pragma once

#include <cstdint>
#include <optional>

#include "firmware/sync/drift.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

enum class Following : std::uint8_t {
  kUnknown,      ///< too few exposures
  kFollows,      ///< the delay from the pulse to its exposure is constant
  kDrifts,       ///< the delay grows or shrinks: its own clock starts the exposures
  kSkipsPulses,  ///< its frames are those of every second pulse, or of fewer
};

/// A driver does not report whether its device follows a line, so this class derives it from the delays (skews) between
/// pulses and exposures. A DriftMeter measures how fast the delay changes. The delay jumps when a cable is plugged in,
/// or when a driver reports a new exposure time too late; the measurement then starts again. The delay of a head that
/// exposes at another rate jumps repeatedly, which counts as drift.
///
/// The result is kDrifts when the mean delay of the newer half of DriftMeter's blocks differs from that of the older
/// half by more than kSigmas standard deviations, which are computed from timestamp errors (clock_spec.h) of the pulse
/// and of the exposure. At 29.97 Hz a drift of 50 ppm is detected within 8 s of the start, or of a cable's removal.
///
/// Threading: thread-bound.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class PulseWatch {
 public:
  void restart(FrameRate rate);
  /// A frame whose exposure began `skew` after the nearest pulse, with the device's own frame counter.
  void add(std::uint64_t pulse, Duration skew, std::uint32_t sequence);
  Following state() const;
  /// Drift of the head's exposures relative to the pulses; positive: they become later. 0 before it is known.
  std::int32_t drift_ppb() const { return drift_.ppb().value_or(0); }

 private:
  static constexpr Duration kJump = Duration::milliseconds(1);  ///< more than errors of two timestamps add up to
  static constexpr int kFewJumps = 4;  ///< more of them without kCalm exposures in between are drift
  static constexpr int kCalm = 64;
  static constexpr int kSkipsToReport = 8;  ///< consecutive frames
  static constexpr double kSigmas = 5;      ///< by chance once in two million measurements, which are one second apart

  struct Exposure {
    std::uint64_t pulse = 0;
    Duration skew;
    std::uint32_t sequence = 0;
  };
  void measure_again();
  double least_drift_ppb() const;

  FrameRate rate_;
  std::optional<Exposure> last_;
  int since_jump_ = 0;  ///< exposures since the delay jumped, at most kCalm
  int jumps_ = 0;       ///< since the last calm, at most kFewJumps + 1
  Duration delay_;      ///< since the first exposure; continuous where the skew wraps from half a period to minus half
  std::int64_t exposures_ = 0;  ///< exposures since the measurement began
  int skips_ = 0;
  DriftMeter drift_;
};

}  // namespace nodal::firmware
