// What every HeadPort and HeadEnumerator must hold. An implementation takes part by a HeadWorld and a kind of it in
// head_worlds.cpp.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <ostream>
#include <string>

#include "hal/clock.h"
#include "hal/head.h"
#include "hal/trigger.h"

namespace nodal::hal {

/// A place with one head that is not open yet, whose frames come by themselves in free run.
class HeadWorld {
 public:
  virtual ~HeadWorld() = default;
  virtual HeadEnumerator& enumerator() = 0;
  virtual std::string path() = 0;
  virtual ClockPort& clock() = 0;
  /// Lets time pass: virtual worlds advance, real ones wait.
  virtual void pass(Duration time) = 0;
  /// What pulses the head's trigger input; null when there is nothing.
  virtual TriggerPort* trigger() { return nullptr; }
  /// Pulls the head's plug; false when this world cannot.
  virtual bool unplug() { return false; }
  /// Plugs it in again while the old head's object is still there; false when this world cannot.
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
  /// The next frame, waiting a few periods for it; fails the test when none comes.
  FrameView next(HeadPort& head);

  std::unique_ptr<HeadWorld> world_ = GetParam().make();
};

}  // namespace nodal::hal
