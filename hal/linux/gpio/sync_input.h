// Numbers the pulses of a line that another device drives, and distinguishes lost from doubled edges.
#pragma once

#include <cstdint>
#include <optional>

#include "hal/trigger.h"

namespace nodal::hal::gpio {

/// Predicts every pulse from those before it. An edge within 1/kWindow of a period of a predicted one is that pulse,
/// and predicted ones in between were lost. Any other edge is doubled (noise, ringing) and is discarded. After kJump
/// discarded edges in a row that are one period apart, the source has a new phase, and they are pulses.
///
/// Threading: thread-bound.
/// Errors: none.
class SyncInput {
 public:
  static constexpr int kJump = 3;
  static constexpr int kWindow = 8;
  /// A prediction moves by 1/kFilter of its error, so that one bad edge does not lead it.
  static constexpr int kFilter = 4;

  void start(FrameRate rate, Instant from);
  /// An edge in order of time; `after_overrun`: the kernel discarded edges before it, or may have. Returns the pulse,
  /// or nothing when the edge is discarded.
  std::optional<TriggerEdge> add(Instant at, bool after_overrun);
  const TriggerCounts& counts() const { return counts_; }

 private:
  TriggerEdge accept(Instant at, std::uint64_t steps, Instant predicted);
  bool jumped(Instant at);

  FrameRate rate_;
  Instant from_;
  bool known_ = false;
  std::uint64_t number_ = 0;  ///< number of the newest pulse
  Instant newest_;            ///< smoothed time of the newest pulse
  Instant discarded_;         ///< the newest discarded edge
  int regular_ = 0;           ///< discarded edges in a row, each one period after the one before
  TriggerCounts counts_;
};

}  // namespace nodal::hal::gpio
