// Assigns frames to sets by the time of their exposure.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "hal/trigger.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// Numbers the rig's exposures. With genlock, a frame's number is that of the trigger pulse at which it began. In free
/// run, it is the number of the frame period that contains it, on a grid that follows the sets. There, a head's next
/// frame is assigned to the next period as long as it lies within 0.6 periods of that period's middle, so that a head
/// whose phase is at the border of two periods does not alternate between them. Numbers only increase, are internal to
/// assembly, and are never reset.
///
/// Threading: thread-bound to capture.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class SetClock {
 public:
  using Slot = std::int64_t;

  explicit SetClock(FrameRate rate) : period_(rate.period()) {}

  /// Discards the grid and the pulses, because the heads were restarted. With genlock, earlier exposures have no pulse.
  void restart(FrameRate rate, bool genlocked, Instant now);
  void on_edge(const hal::TriggerEdge& edge);

  struct Match {
    Slot slot = 0;
    std::optional<std::uint64_t> trigger;
    Duration skew;  ///< with genlock: from the pulse to the begin of the exposure; else: from the middle of the period
  };
  /// With genlock, a frame without a pulse nearby is assigned by the grid, so that a pulse that was not seen costs
  /// synchronization and no frame. Nothing: the frame is older than every stored pulse.
  std::optional<Match> match(std::size_t head, Instant mid_exposure, Exposure exposure, Duration trigger_delay);
  /// A set of this slot was closed: the grid moves towards it by an eighth of the distance.
  void follow(Slot slot, Instant mid_exposure);

  Duration period() const { return period_; }
  /// The expected middle of this slot's exposures.
  Instant middle_of(Slot slot) const { return anchor_time_ + period_ * (slot - anchor_slot_); }

 private:
  Match match_grid(std::size_t head, Instant mid_exposure);
  void use(std::size_t head, Slot slot, Instant mid_exposure);

  /// Frames arrive within the open sets and the 2.5 periods until a set closes; this is several times as many pulses.
  static constexpr std::size_t kEdges = 32;
  static constexpr std::int64_t kReachTenths = 6;  ///< how far from its slot an exposure may be, tenths of a period
  /// By its timestamp, an exposure just before the first pulse may seem to be later than it really was by up to this
  /// time, which is more than twice the timestamp error of clock_spec.h; pulse 0 comes later.
  static constexpr Duration kStampsOff = Duration::microseconds(500);

  struct Step {
    Slot slot = 0;
    Instant mid_exposure;
  };

  Duration period_;
  bool genlocked_ = false;
  Instant since_;
  Slot base_ = 0;  ///< slot of pulse 0
  Slot highest_ = 0;
  std::array<hal::TriggerEdge, kEdges> edges_{};
  std::uint64_t edge_count_ = 0;
  std::array<std::optional<Step>, kMaxHeads> last_{};  ///< each head's newest exposure and its slot
  bool anchored_ = false;
  Slot anchor_slot_ = 0;
  Instant anchor_time_;
};

}  // namespace nodal::firmware
