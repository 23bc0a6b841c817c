// A supervisor that records the daemon's notifications.
#pragma once

#include <string>
#include <vector>

#include "hal/clock.h"
#include "hal/watchdog.h"

namespace nodal::hal::sim {

/// Threading: thread-bound to the supervisor.
/// Ownership: refers to the clock.
/// Errors: none.
class SimWatchdog final : public WatchdogPort {
 public:
  explicit SimWatchdog(ClockPort& clock) : clock_(clock), last_(clock.now()) {}

  // What the daemon uses.
  void ready() override {
    ready_ = true;
    last_ = clock_.now();
  }
  void feed() override {
    ++feeds_;
    last_ = clock_.now();
  }
  void stopping() override { stopping_ = true; }
  void status(std::string_view line) override { lines_.emplace_back(line.substr(0, line.find_first_of("\r\n"))); }

  // What the test uses.
  bool is_ready() const { return ready_; }
  bool is_stopping() const { return stopping_; }
  std::uint64_t feeds() const { return feeds_; }
  const std::vector<std::string>& lines() const { return lines_; }
  /// Whether a real supervisor would have killed the daemon by now.
  bool would_bite(Duration timeout) const { return ready_ && clock_.now() - last_ > timeout; }

 private:
  ClockPort& clock_;
  Instant last_;
  bool ready_ = false;
  bool stopping_ = false;
  std::uint64_t feeds_ = 0;
  std::vector<std::string> lines_;
};

}  // namespace nodal::hal::sim
