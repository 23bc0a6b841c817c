// Drives or follows the trigger, or does without, and says, honestly, whether the heads are exposed together.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "firmware/frame/frame_set.h"
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
  kUnheeded,       ///< a set whose heads are in step, and one of them was moved and did not move
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
/// | unheeded       | off       | acquiring | holdover  | holdover  | lost      |
/// | pulses overdue | off       | lost      | holdover  | holdover  | lost      |
/// | sets overdue   | off       | acquiring | lost      | lost      | lost      |
/// | port gone      | off       | lost      | lost      | lost      | lost      |
/// | coasted long   | off       | acquiring | locked    | lost      | lost      |
GenlockState genlock_after(GenlockState state, GenlockCondition condition);

struct GenlockReport {
  GenlockState state = GenlockState::kOff;
  bool aligned = false;    ///< without pulses: the heads run free and are moved
  HeadMask fixed = 0;      ///< of them, those that cannot be moved,
  HeadMask one_way = 0;    ///< that can only wait, and are behind the others,
  HeadMask unheeding = 0;  ///< and that were moved and did not move
  FrameRate rate;
  std::uint64_t triggers = 0;             ///< pulses seen since start
  std::uint64_t missing = 0;              ///< pulses whose number never came
  Duration spread;                        ///< of mid-exposures, of the newest set with every present head in it
  Duration spread_worst;                  ///< likewise, of the sets while locked, since the genlock was started
  std::uint64_t losses = 0;               ///< times it was lost, since start
  std::uint64_t holdovers = 0;            ///< times it coasted, since start
  std::optional<std::int32_t> drift_ppb;  ///< of the pulses, or of the heads in free run; see SyncEvidence
};

/// A set is good when its frames began within kLockLimit of each other, counted from their pulse and their own delay,
/// and as long after it as when they first locked: a latency that all heads share is no fault, one that creeps is.
/// What is known of when they began jitters; so what the past of every head says is judged too, against a limit that
/// leaves room for the jitter that was seen: a head that creeps away is noticed before it is kLockLimit away, not when
/// jitter happens to show it. Heads that jitter alike may do so in truth, which every set then shows, or only by what is
/// known of them, which the past evens out. Where one jitters unlike the others, it is both.
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
  /// What stamps of frames are off by even where a driver makes them: so little under the limit, nobody can say that
  /// heads are within it.
  static constexpr Duration kStampDoubt = Duration::microseconds(20);
  static constexpr int kSetsToLock = 4;
  static constexpr Duration kHoldover = Duration::seconds(5);  ///< 100 ppm apart makes kLockLimit of it

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
  /// A set that was closed; `unheeding` are heads that were moved and did not move.
  void on_set(const FrameSet& set, const Skews& skews, bool every_present_head, Instant now, HeadMask unheeding = 0);

  GenlockState state() const { return state_; }
  const hal::TriggerSettings& settings() const { return settings_; }
  GenlockReport report() const;

 private:
  /// Until it is known: the past is then trusted to 0.2 ms, twice this.
  static constexpr Duration kJitterAtFirst = Duration::microseconds(100);
  /// After as long without an exposure the past of a head that runs free says nothing: two are then 0.1 ms elsewhere.
  static constexpr Duration kPastHolds = Duration::seconds(1);

  struct Habit {                       ///< of a head, while its exposures have pulses
    std::int64_t skews = 0;            ///< that went into it since the last leap, up to kMean
    Duration mean, mean_of_means;      ///< of its skews, running
    Duration jitter = kJitterAtFirst;  ///< running mean of a skew's distance from what its past says
    Duration lean;                     ///< running mean of that distance with its sign, over four sets
    Duration offset;                   ///< running mean of its mid-exposure after the set's
    Instant newest;                    ///< set's middle that it was in

    /// Brown's double exponential smoothing: what the mean says, without its lag behind a head that creeps.
    Duration skew() const { return mean * 2 - mean_of_means; }
  };

  void begin(Instant now);
  void meet(GenlockCondition condition, Instant now);
  bool pulses_overdue(Instant now) const;
  bool follows_pulses(const Skews& skews, Instant at);
  void learn(const FrameSet& set, const Skews& skews);
  bool is_as_in_lock(const FrameSet& set) const;

  hal::TriggerPort* port_;
  hal::TriggerSettings settings_;
  GenlockState state_ = GenlockState::kOff;
  bool aligned_ = false;
  bool failed_ = false;  ///< the port is gone for good
  Instant newest_edge_;  ///< or the start, before the first
  Instant coasting_since_;
  static constexpr std::int64_t kMean = 16;  ///< running means take a sixteenth of what is new

  std::optional<Instant> newest_set_;
  Instant newest_middle_;  ///< of it
  std::uint64_t next_number_ = 0;
  int good_sets_ = 0;
  bool was_locked_ = false;  ///< since start
  Duration latency_;         ///< middle of the skews of the first good set of the first lock
  std::array<Habit, kMaxHeads> habits_{};
  GenlockReport report_;
};

}  // namespace nodal::firmware
