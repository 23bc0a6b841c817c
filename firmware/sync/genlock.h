// Drives or follows the trigger, or works without one, and reports whether the heads are exposed together.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "firmware/frame/frame_set.h"
#include "firmware/sync/clock_spec.h"
#include "firmware/sync/offset_filter.h"
#include "firmware/sync/phase_line.h"
#include "firmware/sync/pulse_watch.h"
#include "hal/trigger.h"
#include "protocol/base/frame_time.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// How much later a set's exposures began than their pulse plus the head's own delay; without pulses, how much later
/// their middles were than those of the other heads.
struct Skews {
  HeadMask known = 0;  ///< heads whose exposure was matched to a pulse
  std::array<Duration, kMaxHeads> of{};
  std::array<Duration, kMaxHeads> moved{};  ///< the part of it that nudges of the rig caused since the head's last set

  void add(std::size_t head, Duration skew, Duration by_us = {}) {
    known |= head_bit(head);
    of[head] = skew;
    moved[head] = by_us;
  }
};

/// The events that change the genlock's state.
enum class GenlockCondition : std::uint8_t {
  kStarted,
  kStopped,
  kInStep,         ///< kSetsToLock good sets in a row
  kOutOfStep,      ///< a set that is not good
  kPulseUnseen,    ///< a set without a pulse, its heads relative to each other as in lock
  kUnresponsive,   ///< a set whose heads are in step, but one of them did not carry out a nudge
  kPulsesOverdue,  ///< no pulse was seen for more than 2.5 periods
  kSetsOverdue,    ///< no set was closed for 3 periods
  kPortGone,       ///< the trigger's port failed permanently
  kCoastedLong,    ///< holdover has lasted longer than kHoldover
};
inline constexpr std::size_t kGenlockConditions = 10;
std::string_view genlock_condition_name(GenlockCondition condition);

/// The table of all transitions; genlock.cpp contains no other state logic.
///
/// | condition      | off       | acquiring | locked    | holdover  | lost      |
/// |----------------|-----------|-----------|-----------|-----------|-----------|
/// | started        | acquiring | acquiring | acquiring | acquiring | acquiring |
/// | stopped        | off       | off       | off       | off       | off       |
/// | in step        | off       | locked    | locked    | locked    | locked    |
/// | out of step    | off       | acquiring | lost      | lost      | lost      |
/// | pulse unseen   | off       | acquiring | holdover  | holdover  | lost      |
/// | unresponsive   | off       | acquiring | holdover  | holdover  | lost      |
/// | pulses overdue | off       | lost      | holdover  | holdover  | lost      |
/// | sets overdue   | off       | acquiring | lost      | lost      | lost      |
/// | port gone      | off       | lost      | lost      | lost      | lost      |
/// | coasted long   | off       | acquiring | locked    | lost      | lost      |
GenlockState genlock_after(GenlockState state, GenlockCondition condition);

/// Whether a head follows the pulses on a line that its driver does not know.
struct WiredReport {
  Following state = Following::kUnknown;
  std::int32_t drift_ppb = 0;  ///< relative to the pulses
};

struct GenlockReport {
  GenlockState state = GenlockState::kOff;
  bool aligned = false;       ///< without pulses: the heads run free and are nudged
  HeadMask fixed = 0;         ///< heads that cannot be moved
  HeadMask one_way = 0;       ///< heads that are later than the others and can only be delayed
  HeadMask unresponsive = 0;  ///< heads that did not carry out a nudge
  std::array<WiredReport, kMaxHeads> wired{};
  FrameRate rate;
  std::uint64_t triggers = 0;             ///< pulses seen since start
  std::uint64_t missing = 0;              ///< pulses whose number was skipped
  hal::TriggerCounts losses_of_port;      ///< since the port was made
  Duration spread;                        ///< spread of the mid-exposures in the newest set that has every present head
  Duration spread_worst;                  ///< the largest spread of a set while locked, since the genlock was started
  std::uint64_t losses = 0;               ///< how often lock was lost since the start
  std::uint64_t holdovers = 0;            ///< how often it went into holdover since the start
  std::optional<std::int32_t> drift_ppb;  ///< drift of the pulses, or of the heads in free run; see SyncEvidence
};

/// Every head has a Kalman filter over the offset and the drift of its skews (OffsetFilter), with the noise that
/// clock_spec.h states. A set is good when three bounds hold:
/// - for every two heads, the distance of their estimates + 3 standard deviations of it is at most kSafeLimit;
/// - the set's own skews are at most kSafeLimit apart, because timestamps may be exact;
/// - the middle of the skews is within kLockLimit of its value at the first lock: a constant latency of all heads is
///   accepted, a growing one is not.
/// A skew 3 standard deviations away from its prediction is a jump: the filter starts again with it.
///
/// If a head lost its trigger and runs free while the pulses jitter, its skew contains that jitter with the opposite
/// sign. After every set, Page's test compares the likelihoods of the skew with and without this jitter. A suspected
/// head must pass the bounds under both assumptions; a head that certainly runs free is out of step.
///
/// In holdover no pulses are seen; a set is good if its heads are relative to each other as they were in lock.
///
/// Without pulses (align()) the heads run free and an Aligner moves them. The same bounds then apply to the middles of
/// the exposures; in holdover the heads are in step, but one of them cannot be kept in step.
///
/// Threading: thread-bound to capture.
/// Ownership: the port outlives it.
/// Errors: start() returns the port's.
class Genlock {
 public:
  static constexpr Duration kLockLimit = Duration::microseconds(500);
  /// The limit minus what estimates do not contain: timestamp errors of two drivers, and the drift until the next set.
  static constexpr Duration kSafeLimit = kLockLimit - clock_spec::kDriverTimestampError * 2 - clock_spec::kCreepPerSet;
  /// Good sets in a row. The first set after a start is never good, because the uncertainty of one measurement is
  /// 3 x sqrt(2) x 115 us = 490 us; so a lock takes 4 sets.
  static constexpr int kSetsToLock = 3;
  /// Two crystals differ by up to 100 ppm: kLockLimit in 5 s.
  static constexpr Duration kHoldover = Duration::seconds(5);

  /// `port` may be null: then start() is kNoSuchDevice.
  explicit Genlock(hal::TriggerPort* port) : port_(port) {}

  Status start(const hal::TriggerSettings& settings, Instant now);
  /// Heads run free at this rate, and are nudged until they are in step.
  void align(FrameRate rate, Instant now);
  void stop();
  bool aligning() const { return running() && aligned_; }
  bool running() const { return state_ != GenlockState::kOff; }
  /// The next pulse, for the set clock; nothing if there is none. Call it until it returns nothing, then step().
  std::optional<hal::TriggerEdge> take_edge(Instant now);
  void step(Instant now);
  /// Adds what wakes capture for the next pulse, after take_edge() found none.
  void add_wake_ups(hal::WakeUps& to) const {
    if (port_ != nullptr && running() && !aligned_) port_->add_wake_ups(to);
  }
  /// Reports a closed set; `unresponsive` are heads that did not carry out a nudge.
  void on_set(const FrameSet& set, const Skews& skews, bool every_present_head, Instant now, HeadMask unresponsive = 0);

  GenlockState state() const { return state_; }
  const hal::TriggerSettings& settings() const { return settings_; }
  GenlockReport report() const;

 private:
  /// After this time without an exposure, a head that runs free may have been restarted with any phase.
  static constexpr FrameTime kHistoryValid{Duration::seconds(1), 3};
  /// The filter of a head that follows pulses assumes no longer period. A head that loses its trigger at a lower rate
  /// is elsewhere by more than the noise of a timestamp at the next pulse already, which counts as a jump; for one that
  /// follows, its estimate would never become certain enough for a lock.
  static constexpr Duration kLongestPeriod = Duration::milliseconds(200);
  /// Offsets are means of 16 sets, whose error is a quarter of that of one set: 50 us instead of 200.
  static constexpr std::int64_t kMean = 16;
  static constexpr double kSigmas = 3;  ///< standard deviations that count as certain
  /// Page's test: by chance, the sum of log-likelihood ratios reaches h at most once in e^h sets: 1100 sets for a
  /// suspicion, which ends a lock only if heads are already far apart, and 160 000 for certainty.
  static constexpr double kSuspicious = 7, kRunsFree = 12;
  static constexpr std::size_t kPulsesKept = 32;  ///< as many as SetClock keeps

  struct HeadEstimate {
    bool known = false;
    OffsetFilter skew;
    /// Page's sum, 0 to kRunsFree: evidence that it runs free and does not follow its pulses.
    double free_evidence = 0;
    Duration offset;  ///< running mean of its mid-exposure relative to the set's
    Instant newest;   ///< the middle of its newest set
  };
  struct Pulse {
    std::uint64_t number = 0;
    double late_us = 0;  ///< relative to the expected pulse
  };

  void begin(Instant now);
  void meet(GenlockCondition condition, Instant now);
  bool pulses_overdue(Instant now) const;
  void add_pulse(const hal::TriggerEdge& edge);
  double lateness_us(const FrameSet& set) const;
  void estimate(HeadEstimate& head, double skew_us, Instant at, double pulse_late_us);
  bool estimates_in_step(HeadMask heads, double pulse_late_us) const;
  bool follows_pulses(const Skews& skews, const FrameSet& set);
  void learn(const FrameSet& set, const Skews& skews);
  bool is_as_in_lock(const FrameSet& set) const;

  hal::TriggerPort* port_;
  hal::TriggerSettings settings_;
  GenlockState state_ = GenlockState::kOff;
  bool aligned_ = false;
  bool failed_ = false;  ///< the port failed permanently
  Instant newest_edge_;  ///< or the start, before the first
  Instant coasting_since_;
  std::optional<Instant> newest_set_;
  Instant newest_middle_;  ///< mid-exposure of the newest set
  std::uint64_t next_number_ = 0;
  int good_sets_ = 0;
  bool was_locked_ = false;  ///< since start
  Duration latency_;         ///< middle of the skews of the first good set of the first lock
  PhaseLine beat_;           ///< phase and rate of the pulses
  std::array<Pulse, kPulsesKept> pulses_{};
  std::array<HeadEstimate, kMaxHeads> heads_{};
  GenlockReport report_;
};

}  // namespace nodal::firmware
