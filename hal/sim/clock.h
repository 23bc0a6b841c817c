// The simulated rig's clock: a virtual clock that only the test advances, or the machine's own clock.
#pragma once

#include <atomic>

#include "hal/clock.h"

namespace nodal::hal::sim {

/// Threading: thread-safe.
/// Ownership: none.
/// Errors: none. Moving backwards, or moving real time, is a programming error.
class SimClock final : public ClockPort {
 public:
  /// Virtual time starts at one second and stands still until it is advanced; real time is CLOCK_MONOTONIC.
  enum class Kind : std::uint8_t { kVirtual, kReal };
  explicit SimClock(Kind kind = Kind::kVirtual) : real_(kind == Kind::kReal) {}

  // What the daemon uses.
  Instant now() override;

  // What the test uses; for virtual time only.
  bool is_virtual() const { return !real_; }
  void advance_to(Instant at);
  void advance(Duration by) { advance_to(now() + by); }

 private:
  const bool real_;
  std::atomic<std::int64_t> now_ns_{1'000'000'000};
};

}  // namespace nodal::hal::sim
