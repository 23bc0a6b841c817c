// Simulated lines: an output that returns to its safe level, and an input with edges scripted by a test.
#pragma once

#include <atomic>
#include <deque>
#include <vector>

#include "hal/clock.h"
#include "hal/pin.h"

namespace nodal::hal::sim {

/// Threading: thread-bound to its stage.
/// Ownership: none.
/// Errors: kDeviceGone after unplug().
class SimOutputPin final : public OutputPinPort {
 public:
  static constexpr std::ptrdiff_t kKept = 65'536;

  explicit SimOutputPin(bool safe_level) : safe_(safe_level), high_(safe_level) {}

  // What the daemon uses.
  Status set(bool high, Instant now, Duration lease) override;
  Status step(Instant now) override;
  void make_safe() noexcept override { made_safe_.store(true); }

  // What the test uses.
  void unplug() { gone_ = true; }
  /// The level on the line at `now`; the lease ends even if step() is not called.
  bool level_at(Instant now) const { return made_safe_.load() || now >= until_ ? safe_ : high_; }
  /// Changes of level, oldest first; at least the newest kKept / 2 are kept.
  const std::vector<PinEdge>& history() const { return history_; }

 private:
  void drive(bool high, Instant at);

  const bool safe_;
  bool high_;
  bool gone_ = false;
  std::atomic<bool> made_safe_{false};  ///< permanently
  Instant until_;
  std::vector<PinEdge> history_;
};

/// Threading: thread-bound to its stage.
/// Ownership: refers to the clock.
/// Errors: kDeviceGone after unplug().
class SimInputPin final : public InputPinPort {
 public:
  explicit SimInputPin(ClockPort& clock, bool level = false) : clock_(clock), high_(level) {}

  // What the daemon uses.
  Result<bool> level() override;
  Result<std::optional<PinEdge>> take_edge() override;

  // What the test uses.
  /// Sets the line to `high` at time `at`; call in order of time. If the level does not change there is no edge.
  void script(Instant at, bool high) { script_.push_back({at, high}); }
  void unplug() { gone_ = true; }

 private:
  void play();

  ClockPort& clock_;
  bool high_;
  bool gone_ = false;
  std::deque<PinEdge> script_;
  std::deque<PinEdge> edges_;
};

}  // namespace nodal::hal::sim
