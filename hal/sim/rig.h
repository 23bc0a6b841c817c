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
  ScenePtr scene;                                       ///< null: the town square
  HeadOptions head;                                     ///< options that all heads share
  std::function<void(HeadIndex, HeadOptions&)> adjust;  ///< changes the options of single heads; may be empty
  TriggerOptions trigger;
};

/// The path of a head is "sim:" and its name in the truth, such as "sim:cam3".
///
/// Threading: thread-bound to capture; only the clock is thread-safe. While no head is open, prepare() may run for
///   different heads on different threads.
/// Ownership: owns all its parts; destroy ports from the enumerator first.
/// Errors: as the ports.
class SimRig {
 public:
  /// `truth` must be checked.
  SimRig(const Calibration& truth, SimRigOptions options);
  ~SimRig();

  SimClock& clock() { return clock_; }
  SimTrigger& trigger() { return trigger_; }
  HeadEnumerator& enumerator();
  const Calibration& truth() const { return truth_; }

  int head_count() const { return static_cast<int>(heads_.size()); }
  SimHead& head(int index) { return *heads_.at(static_cast<std::size_t>(index)); }
  /// Null if the truth has no such head.
  SimHead* find(const std::string& path);

  /// Renders a head's static scene before its first frame is due (a quarter of a second or more for a big picture);
  /// otherwise the first frame does it. In real time, call it for every head before opening any.
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
