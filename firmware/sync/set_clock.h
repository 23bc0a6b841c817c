// Which set a frame belongs to, from when it was exposed.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "hal/trigger.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// Numbers the rig's exposures. Genlocked, a frame's number is that of the trigger pulse it began at; in free run, that
/// of the frame period it lies in, on a grid that follows the sets. There a head keeps its step: its next frame is of
/// the next period as long as it lies within 0.6 periods of that one's middle, so that a head whose phase is where two
/// periods meet does not go to and fro. Numbers only rise; they are internal to assembly and start again nowhere.
///
/// Threading: thread-bound to capture.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class SetClock {
 public:
  using Slot = std::int64_t;

  explicit SetClock(FrameRate rate) : period_(rate.period()) {}

  /// Forgets the grid and the pulses: the heads were started anew. Genlocked, what was exposed before is of no pulse.
  void restart(FrameRate rate, bool genlocked, Instant now);
  void on_edge(const hal::TriggerEdge& edge);

  struct Match {
    Slot slot = 0;
    std::optional<std::uint64_t> trigger;
    Duration skew;  ///< genlocked: begin of the exposure after its pulse; else: from the grid's middle
  };
  /// Genlocked, a frame that has no pulse near goes by the grid, so that a pulse that was not seen costs the sync and
  /// not the picture. Nothing: it is older than every pulse that is remembered.
  std::optional<Match> match(std::size_t head, Instant mid_exposure, Exposure exposure, Duration trigger_delay);
  /// A set of this slot was closed: the grid goes an eighth of the way to it.
  void follow(Slot slot, Instant mid_exposure);

  Duration period() const { return period_; }
  /// When the middle of this slot's exposures is to be expected.
  Instant middle_of(Slot slot) const { return anchor_time_ + period_ * (slot - anchor_slot_); }

 private:
  Match match_grid(std::size_t head, Instant mid_exposure);
  void use(std::size_t head, Slot slot, Instant mid_exposure);

  /// Frames come within the open sets and the 2.5 periods until a set closes; this is several times as many pulses.
  static constexpr std::size_t kEdges = 32;
  static constexpr std::int64_t kReachTenths = 6;  ///< of a period
  /// What was exposed just before the pulses began may seem to have been after it by this much, which is more than
  /// twice the error of a timestamp in clock_spec.h; pulse 0 comes later.
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
  std::array<std::optional<Step>, kMaxHeads> last_{};  ///< of each head
  bool anchored_ = false;
  Slot anchor_slot_ = 0;
  Instant anchor_time_;
};

}  // namespace nodal::firmware
