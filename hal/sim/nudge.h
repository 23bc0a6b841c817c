// How a simulated head shifts its exposures in free run.
#pragma once

#include <algorithm>
#include <deque>

#include "hal/head.h"

namespace nodal::hal::sim {

/// The requested shifts of a head: the part not yet executed, and the sum of the executed part.
class Nudges {
 public:
  void restart() { *this = {}; }
  /// Rounds to a step, half away from zero.
  void ask(Duration by, const NudgeLimits& limits) {
    const std::int64_t step = limits.step.ns();
    const std::int64_t steps = ((by < Duration() ? -by.ns() : by.ns()) + step / 2) / step;
    pending_.push_back({limits.step * (by < Duration() ? -steps : steps), std::max(limits.latency_frames, 1)});
  }
  /// At the start of an exposure: the period to the next one is longer by the amount that this adds to done(). `room`
  /// is the most by which the sensor can shorten that period.
  void next_period(const NudgeLimits& limits, Duration room) {
    for (Asked& asked : pending_) --asked.frames_left;
    while (!pending_.empty() && pending_.front().frames_left <= 0) {
      left_ = left_ + pending_.front().by;
      pending_.pop_front();
    }
    if (left_ == Duration()) return;
    const Duration shortest = std::min(std::max(limits.shortest, -room), Duration());
    const Duration by = limits.step * (std::clamp(left_, shortest, limits.longest).ns() / limits.step.ns());
    left_ = left_ - by;
    done_ = done_ + by;
  }
  Duration done() const { return done_; }

 private:
  struct Asked {
    Duration by;
    int frames_left = 0;
  };
  std::deque<Asked> pending_;
  Duration left_, done_;
};

}  // namespace nodal::hal::sim
