// The tests that every HeadPort and HeadEnumerator must pass. To add an implementation: add a HeadWorld and its kind to
// head_worlds.cpp.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <ostream>
#include <string>

#include "hal/clock.h"
#include "hal/head.h"
#include "hal/trigger.h"

namespace nodal::hal {

/// An environment with one head, not open yet, that sends frames by itself in free run.
class HeadWorld {
 public:
  virtual ~HeadWorld() = default;
  virtual HeadEnumerator& enumerator() = 0;
  virtual std::string path() = 0;
  virtual ClockPort& clock() = 0;
  /// Lets time pass: virtual worlds advance their clock, real ones wait.
  virtual void pass(Duration time) = 0;
  /// Lets time pass until `wake_ups` ends the sleep, at most `at_most`. Returns whether it did. The default is for
  /// worlds whose ports report times.
  virtual bool sleep(const WakeUps& wake_ups, Duration at_most) {
    const Instant now = clock().now();
    const Instant until = std::min(wake_ups.at().value_or(now + at_most), now + at_most);
    if (until > now) pass(until - now);
    return wake_ups.at() && *wake_ups.at() <= clock().now();
  }
  /// The source of pulses for the head's trigger input; null if there is none.
  virtual TriggerPort* trigger() { return nullptr; }
  /// Unplugs the head; false if this world cannot.
  virtual bool unplug() { return false; }
  /// Plugs it in again while the old head's object still exists; false if this world cannot.
  virtual bool replug() { return false; }
};

struct HeadWorldKind {
  std::string name;
  std::function<std::unique_ptr<HeadWorld>()> make;
  friend std::ostream& operator<<(std::ostream& out, const HeadWorldKind& kind) { return out << kind.name; }
};

class HeadConformance : public testing::TestWithParam<HeadWorldKind> {
 protected:
  std::unique_ptr<HeadPort> open();
  std::unique_ptr<HeadPort> open_streaming();
  /// Waits up to a few periods for the next frame; fails the test if there is none.
  FrameView next(HeadPort& head);

  std::unique_ptr<HeadWorld> world_ = GetParam().make();
};

}  // namespace nodal::hal
