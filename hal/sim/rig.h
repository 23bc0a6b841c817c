// A whole simulated rig in a scene: clock, trigger, heads and their enumerator.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "hal/head.h"
#include "hal/sim/clock.h"
#include "hal/sim/head.h"
#include "hal/sim/scene/scene.h"
#include "hal/sim/trigger.h"
#include "protocol/calibration.h"

namespace nodal::hal::sim {

struct SimRigOptions {
  bool real_time = false;
  std::uint64_t seed = 1;
  ScenePtr scene;                                       ///< none: the town square
  HeadOptions head;                                     ///< of every head
  std::function<void(HeadIndex, HeadOptions&)> adjust;  ///< changes the options of single heads; may be empty
  TriggerOptions trigger;
};

/// Heads are opened by path: "sim:" and the head's name in the truth, such as "sim:cam3".
///
/// Threading: thread-bound to capture; only the clock is thread-safe. While no head is open, prepare() may run for
///   different heads on different threads.
/// Ownership: owns everything in it; ports that the enumerator opened must be gone before it is.
/// Errors: as the ports.
class SimRig {
 public:
  /// `truth` has been checked.
  SimRig(const Calibration& truth, SimRigOptions options);
  ~SimRig();

  SimClock& clock() { return clock_; }
  SimTrigger& trigger() { return trigger_; }
  HeadEnumerator& enumerator();
  const Calibration& truth() const { return truth_; }

  int head_count() const { return static_cast<int>(heads_.size()); }
  SimHead& head(int index) { return *heads_.at(static_cast<std::size_t>(index)); }
  /// Null when the truth has no such head.
  SimHead* find(const std::string& path);

  /// Renders what a head sees before its first frame is due (a quarter second and more for a big picture); without
  /// it the first frame does. In real time, call it for every head before opening any.
  void prepare(int index) { head(index).prepare(); }

 private:
  class Enumerator;
  const Calibration truth_;
  SimClock clock_;
  SimTrigger trigger_;
  std::vector<std::unique_ptr<SimHead>> heads_;
  std::unique_ptr<Enumerator> enumerator_;
};

}  // namespace nodal::hal::sim
