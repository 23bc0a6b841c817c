#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "hal/wake_ups.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::hal {

/// The pulse train that genlocks the heads.
struct TriggerSettings {
  FrameRate rate;       ///< the rate to generate, or to expect
  bool follow = false;  ///< another device drives the line: its pulses are reported and forwarded, none are generated
  Duration pulse_width = Duration::microseconds(100);
  bool active_high = true;
  std::array<Duration, kMaxHeads> delay{};  ///< delay of each head's pulse relative to the trigger
};

/// One pulse, with the time at the board's output.
struct TriggerEdge {
  std::uint64_t number = 0;  ///< counts periods from 0 at start(); a gap is a pulse that was not sent or not detected
  Instant at;
};

/// Counts of pulses that were not delivered and of edges that were discarded, by reason, since the port was created.
struct TriggerCounts {
  std::uint64_t late = 0;     ///< not sent: the thread woke too late
  std::uint64_t refused = 0;  ///< writes of a level that the driver refused
  std::uint64_t unseen = 0;   ///< sent, but not detected at the read-back line
  std::uint64_t lost = 0;     ///< pulses of another device that did not arrive when due
  std::uint64_t overrun = 0;  ///< arrived while the queue of edges was full
  std::uint64_t doubled = 0;  ///< edges that belong to no pulse; discarded
  std::uint64_t jumps = 0;    ///< how often the other device's pulses continued with another phase
  friend bool operator==(const TriggerCounts&, const TriggerCounts&) = default;
};

/// Drives the heads' trigger inputs, or reports the pulses of another device.
///
/// Threading: thread-bound to capture.
/// Ownership: none.
/// Errors: kDeviceGone is final; kBadValue for a rate or width that the hardware cannot generate; kUnsupported for
///   `follow` without an input.
class TriggerPort {
 public:
  virtual ~TriggerPort() = default;
  /// Pulse 0 comes at least a millisecond later: an exposure that began earlier belongs to no pulse.
  virtual Status start(const TriggerSettings& settings) = 0;
  /// Leaves the line at its inactive level. Safe in any state.
  virtual void stop() = 0;
  /// The oldest edge that has not been taken, or nothing.
  virtual Result<std::optional<TriggerEdge>> take_edge() = 0;
  /// Adds what wakes a thread for the next edge, after take_edge() found none. Pulses that the board itself sends need
  /// not wake it: the port keeps them, and they are taken with the frames that they exposed.
  virtual void add_wake_ups(WakeUps& to) const = 0;
  /// The default is for ports without such losses.
  virtual TriggerCounts counts() const { return {}; }
  /// Sets the line to its inactive level permanently, to end the program while the thread of this port hangs; start()
  /// and take_edge() then return kDeviceGone. May be called on any thread, also during another call; returns at once
  /// and takes no lock.
  virtual void make_safe() noexcept = 0;
};

}  // namespace nodal::hal
