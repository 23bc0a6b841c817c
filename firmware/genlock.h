// Drives the trigger and says, honestly, whether the heads follow it.
#pragma once

#include <cstdint>
#include <optional>

#include "firmware/frame_set.h"
#include "hal/trigger.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// How long after their pulse a set's first and last exposures began.
struct Skews {
  Duration earliest;
  Duration latest;
};

struct GenlockReport {
  GenlockState state = GenlockState::kOff;
  FrameRate rate;
  std::uint64_t triggers = 0;   ///< pulses seen since start
  std::uint64_t missing = 0;    ///< pulses whose number never came
  Duration spread;              ///< of the newest set with every present head in it
  Duration spread_worst;        ///< of the sets while locked, since the genlock was started
};

/// | state     | pulse overdue / port failed | heads off, or no set | kSetsToLock good sets | start | stop |
/// |-----------|-----------------------------|----------------------|-----------------------|-------|------|
/// | off       |                             |                      |                       | acquiring | |
/// | acquiring | lost                        | (counts anew)        | locked                | acquiring | off |
/// | locked    | lost                        | lost                 |                       | acquiring | off |
/// | lost      |                             | (counts anew)        | locked                | acquiring | off |
///
/// A pulse is overdue after 2.5 periods, and a set likewise after 3, so that a loss shows within three periods of
/// being visible at all. A set is good when its frames began within kLockLimit of each other, counted from their
/// pulse and their own delay, and as long after it as when they first locked: a latency that all heads share is no
/// fault, one that creeps is.
///
/// Threading: thread-bound to capture.
/// Ownership: the port outlives it.
/// Errors: start() gives the port's.
class Genlock {
 public:
  static constexpr Duration kLockLimit = Duration::microseconds(500);
  static constexpr int kSetsToLock = 4;

  /// `port` may be null: then start() is kNoSuchDevice.
  explicit Genlock(hal::TriggerPort* port) : port_(port) {}

  Status start(const hal::TriggerSettings& settings, Instant now);
  void stop();
  bool running() const { return state_ != GenlockState::kOff; }
  /// The next pulse, for the set clock; nothing when none is there. Call until it gives nothing, then step().
  std::optional<hal::TriggerEdge> take_edge();
  void step(Instant now);
  /// A set that was closed, and its skews; nothing when a frame of it has no pulse.
  void on_set(const FrameSet& set, const std::optional<Skews>& skews, bool every_present_head, Instant now);

  GenlockState state() const { return state_; }
  const hal::TriggerSettings& settings() const { return settings_; }
  GenlockReport report() const;

 private:
  void lose();
  bool is_good(const Skews& skews);

  hal::TriggerPort* port_;
  hal::TriggerSettings settings_;
  GenlockState state_ = GenlockState::kOff;
  bool failed_ = false;  ///< the port is gone for good
  Instant newest_edge_;  ///< or the start, before the first
  std::optional<Instant> newest_set_;
  std::uint64_t edges_ = 0;
  std::uint64_t next_number_ = 0;
  std::uint64_t missing_ = 0;
  int good_sets_ = 0;
  bool was_locked_ = false;  ///< since start
  Duration latency_;  ///< middle of the skews of the first good set of the first lock
  Duration spread_;
  Duration spread_worst_;
};

}  // namespace nodal::firmware
