// Which set a frame belongs to, from when it was exposed.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "hal/trigger.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// Numbers the rig's exposures. Genlocked, a frame's number is that of the trigger pulse it began at; in free
/// run, that of the frame period it lies in, on a grid that follows the heads' mean phase. Numbers only rise;
/// they are internal to assembly and start again nowhere.
///
/// Threading: thread-bound to capture.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class SetClock {
 public:
  using Slot = std::int64_t;

  explicit SetClock(FrameRate rate) : period_(rate.period()) {}

  /// Forgets the grid and the pulses: the heads were started anew.
  void restart(FrameRate rate, bool genlocked);
  void on_edge(const hal::TriggerEdge& edge);

  struct Match {
    Slot slot = 0;
    std::optional<std::uint64_t> trigger;
    Duration skew;  ///< genlocked: begin of the exposure after its pulse; else: from the grid's middle
  };
  /// Genlocked, nothing when no pulse is near. While pulses are missing altogether frames go by the grid, so that a
  /// lost trigger costs the sync and not the picture.
  std::optional<Match> match(Instant mid_exposure, Exposure exposure, Duration trigger_delay, Instant now);

  Duration period() const { return period_; }
  /// When the middle of this slot's exposures is to be expected.
  Instant middle_of(Slot slot) const { return anchor_time_ + period_ * (slot - anchor_slot_); }

 private:
  Match match_grid(Instant mid_exposure);
  void follow(Slot slot, Instant mid_exposure);
  bool pulses_missing(Instant now) const;

  static constexpr std::size_t kEdges = 32;

  Duration period_;
  bool genlocked_ = false;
  Slot base_ = 0;  ///< slot of pulse 0
  Slot highest_ = 0;
  std::array<hal::TriggerEdge, kEdges> edges_{};
  std::uint64_t edge_count_ = 0;
  bool anchored_ = false;
  Slot anchor_slot_ = 0;
  Instant anchor_time_;
};

}  // namespace nodal::firmware
