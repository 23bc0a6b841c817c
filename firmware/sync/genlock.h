// Drives or follows the trigger, or does without, and says, honestly, whether the heads are exposed together.
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
#include "protocol/base/result.h"

namespace nodal::firmware {

/// How long after their pulse, and their own delay, a set's exposures began; without pulses, how long after the others'
/// their middles were.
struct Skews {
  HeadMask known = 0;  ///< heads whose exposure has its pulse
  std::array<Duration, kMaxHeads> of{};
  std::array<Duration, kMaxHeads> moved{};  ///< of it, what the rig did to the head since its last

  void add(std::size_t head, Duration skew, Duration by_us = {}) {
    known |= head_bit(head);
    of[head] = skew;
    moved[head] = by_us;
  }
};

/// What the genlock's state depends on.
enum class GenlockCondition : std::uint8_t {
  kStarted,
  kStopped,
  kInStep,         ///< kSetsToLock good sets in a row
  kOutOfStep,      ///< a set that is not
  kPulseUnseen,    ///< a set that no pulse exposed, its heads where they were in lock
  kUnresponsive,   ///< a set whose heads are in step, and one of them was moved and did not move
  kPulsesOverdue,  ///< none seen for 2.5 periods
  kSetsOverdue,    ///< none closed for 3 periods
  kPortGone,       ///< the trigger's, for good
  kCoastedLong,    ///< in holdover for kHoldover
};
inline constexpr std::size_t kGenlockConditions = 10;
std::string_view genlock_condition_name(GenlockCondition condition);

/// The whole table; genlock.cpp holds nothing else about states.
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
  bool aligned = false;       ///< without pulses: the heads run free and are moved
  HeadMask fixed = 0;         ///< of them, those that cannot be moved,
  HeadMask one_way = 0;       ///< that can only wait, and are behind the others,
  HeadMask unresponsive = 0;  ///< and that were moved and did not move
  std::array<WiredReport, kMaxHeads> wired{};
  FrameRate rate;
  std::uint64_t triggers = 0;             ///< pulses seen since start
  std::uint64_t missing = 0;              ///< pulses whose number never came
  hal::TriggerCounts losses_of_port;      ///< since the port was made
  Duration spread;                        ///< of mid-exposures, of the newest set with every present head in it
  Duration spread_worst;                  ///< likewise, of the sets while locked, since the genlock was started
  std::uint64_t losses = 0;               ///< times it was lost, since start
  std::uint64_t holdovers = 0;            ///< times it coasted, since start
  std::optional<std::int32_t> drift_ppb;  ///< of the pulses, or of the heads in free run; see SyncEvidence
};

/// Every head has a Kalman filter over the offset and the drift of its skews (OffsetFilter), with the noise that
/// clock_spec.h states. A set is good when three bounds hold:
/// - for every two heads, the distance of their estimates + 3 standard deviations of it is at most kSafeLimit;
/// - the set's own skews are at most kSafeLimit apart. They may be exact, and then they are the truth;
/// - the middle of the skews is within kLockLimit of where it was at the first lock: a latency that all heads share is
///   no fault, one that grows is.
/// A skew 3 standard deviations away from its prediction is a jump: the filter starts again from it.
///
/// A head that lost its trigger and runs beside pulses that jitter has that jitter in its skew with the opposite sign.
/// Page's test compares, after every set, how likely the skew is with and without it. A head under suspicion is judged
/// both ways; one that certainly runs by itself is out of step.
///
/// In holdover no pulses are seen, and a set is as good as its heads are where they were against each other in lock.
///
/// Without pulses (align()) the heads run free and an Aligner moves them. A set is then judged likewise by the middles of
/// its exposures, and in holdover the heads are in step and one of them cannot be kept there.
///
/// Threading: thread-bound to capture.
/// Ownership: the port outlives it.
/// Errors: start() gives the port's.
class Genlock {
 public:
  static constexpr Duration kLockLimit = Duration::microseconds(500);
  /// The limit less what no estimate tells: timestamps of two drivers, and the creep until the next set.
  static constexpr Duration kSafeLimit = kLockLimit - clock_spec::kDriverTimestampError * 2 - clock_spec::kCreepPerSet;
  /// Good sets in a row. The first set after a start is never good, because one measurement has 3 x sqrt(2) x 115 us =
  /// 490 us of doubt; so a lock takes 4 sets.
  static constexpr int kSetsToLock = 3;
  /// Two crystals are up to 100 ppm apart, which makes kLockLimit in 5 s.
  static constexpr Duration kHoldover = Duration::seconds(5);

  /// `port` may be null: then start() is kNoSuchDevice.
  explicit Genlock(hal::TriggerPort* port) : port_(port) {}

  Status start(const hal::TriggerSettings& settings, Instant now);
  /// Heads run free at this rate, and somebody moves them until they are in step.
  void align(FrameRate rate, Instant now);
  void stop();
  bool aligning() const { return running() && aligned_; }
  bool running() const { return state_ != GenlockState::kOff; }
  /// The next pulse, for the set clock; nothing when none is there. Call until it gives nothing, then step().
  std::optional<hal::TriggerEdge> take_edge(Instant now);
  void step(Instant now);
  /// A set that was closed; `unresponsive` are heads that were moved and did not move.
  void on_set(const FrameSet& set, const Skews& skews, bool every_present_head, Instant now, HeadMask unresponsive = 0);

  GenlockState state() const { return state_; }
  const hal::TriggerSettings& settings() const { return settings_; }
  GenlockReport report() const;

 private:
  /// After as long without an exposure a head that runs free may have been started anew, with any phase.
  static constexpr Duration kHistoryValid = Duration::seconds(1);
  /// Running means of offsets: the error of a mean of 16 is a quarter of that of one, 50 us of 200.
  static constexpr std::int64_t kMean = 16;
  static constexpr double kSigmas = 3;  ///< standard deviations that count as certain
  /// Page's test: by chance a sum of log-likelihood ratios reaches h once in e^h sets or more rarely: 1100 sets for a
  /// suspicion, which costs a lock only when heads are far apart already, and 160 000 for a verdict.
  static constexpr double kSuspicious = 7, kRunsFree = 12;
  static constexpr std::size_t kPulsesKept = 32;  ///< as many as SetClock keeps

  struct HeadEstimate {
    bool known = false;
    OffsetFilter skew;
    double free_evidence = 0;  ///< Page's sum, 0 to kRunsFree: that it runs free, against that it follows its pulses
    Duration offset;           ///< running mean of its mid-exposure after the set's
    Instant newest;            ///< set's middle that it was in
  };
  struct Pulse {
    std::uint64_t number = 0;
    double late_us = 0;  ///< after the beat of the pulses
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
  bool failed_ = false;  ///< the port is gone for good
  Instant newest_edge_;  ///< or the start, before the first
  Instant coasting_since_;
  std::optional<Instant> newest_set_;
  Instant newest_middle_;  ///< of it
  std::uint64_t next_number_ = 0;
  int good_sets_ = 0;
  bool was_locked_ = false;  ///< since start
  Duration latency_;         ///< middle of the skews of the first good set of the first lock
  PhaseLine beat_;           ///< of the pulses
  std::array<Pulse, kPulsesKept> pulses_{};
  std::array<HeadEstimate, kMaxHeads> heads_{};
  GenlockReport report_;
};

}  // namespace nodal::firmware
