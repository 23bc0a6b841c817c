// A simulated head: a lens model and a sensor on the rig's trigger line. It exists independently of being opened.
// SimRig::enumerator() opens it as a HeadPort; this class is the other half, for the test.
#pragma once

#include <array>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/clock.h"
#include "hal/head.h"
#include "hal/sim/delayed_settings.h"
#include "hal/sim/frame_faults.h"
#include "hal/sim/free_run.h"
#include "hal/sim/head_options.h"
#include "hal/sim/head_picture.h"
#include "hal/sim/scene/random.h"
#include "hal/sim/scene/scene.h"
#include "hal/sim/trigger.h"
#include "protocol/calibration.h"

namespace nodal::hal::sim {

/// The true data of one frame.
struct FrameTruth {
  std::uint32_t sequence = 0;
  std::optional<std::uint64_t> pulse;  ///< the pulse that started it
  Instant exposure_begin;
  Instant mid_exposure;
};

/// At any time: exposed + duplicated = taken + without_buffer + by_fault + discarded + waiting.
struct HeadCounts {
  std::uint64_t exposed = 0;
  std::uint64_t duplicated = 0;      ///< sent twice, by a fault
  std::uint64_t taken = 0;           ///< by take_frame()
  std::uint64_t without_buffer = 0;  ///< lost because the daemon held every buffer
  std::uint64_t by_fault = 0;        ///< lost by a test's order or by the fault rates
  std::uint64_t discarded = 0;       ///< exposed or in a buffer at stop() or unplug()
  std::uint64_t waiting = 0;         ///< exposed and not yet taken
  std::uint64_t pulses_ignored = 0;  ///< the head was still exposing when they came; not frames
};

/// Threading: thread-bound to capture.
/// Ownership: the clock, the trigger and the scene outlive it; it outlives its open port.
/// Errors: none of its own.
class SimHead final : public PulseSink, public FrameFaults {
 public:
  SimHead(ClockPort& clock, SimTrigger& trigger, ScenePtr scene, const HeadCalibration& truth,
          const HeadOptions& options, std::uint64_t seed);
  ~SimHead() override;

  // What the test uses, besides FrameFaults.
  /// While stuck, the head accepts settings and nudges but does not apply them; frames report the real settings.
  void set_stuck(bool stuck) { settings_.set_stuck(stuck); }
  /// A factor on the light that the head sees: a cloud, a lamp.
  void set_light(double factor) { light_ = factor; }
  /// The device's own counter continues from `next`.
  void set_sequence(std::uint32_t next);
  /// A head in wired mode without its cable receives no pulse, so its own clock starts its exposures.
  void set_cable(bool connected) { cable_.connected = connected; }
  /// A head in wired mode exposes only on every n-th pulse.
  void set_pulses_an_exposure(int n) { cable_.pulses_an_exposure = n; }
  void set_faults(const HeadFaults& faults) { options_.faults = faults; }
  /// Unplugs the head; its open port returns kDeviceGone permanently.
  void unplug();
  void replug();
  /// Renders the static scene now, which the first frame would otherwise do.
  void prepare() { picture_.prepare(); }

  // What the test can query.
  const HeadIdentity& identity() const { return identity_; }
  const HeadCalibration& truth() const { return picture_.truth(); }
  const HeadOptions& options() const { return options_; }
  const HeadCounts& counts() const { return counts_; }
  bool present() const { return present_; }
  bool is_open() const { return port_ != nullptr; }
  bool streaming() const { return mode_.has_value(); }
  /// The truth of one of the newest 64 frames.
  std::optional<FrameTruth> truth_of(std::uint32_t sequence) const;

  // What the enumerator uses.
  Result<std::unique_ptr<HeadPort>> open();

  void on_pulse(std::uint64_t number, Instant at) override;
  void on_unseen(std::uint64_t pulses) override;

 private:
  class Port;
  /// The input for pulses of a head in wired mode.
  struct Cable {
    bool connected = true;
    int pulses_an_exposure = 1;
  };

  Status start(TriggerMode mode);
  void stop();
  Status nudge(Duration by);
  void change(const HeadSettings& wanted);
  void step(Instant now);
  /// When the next frame can arrive at the earliest.
  std::optional<Instant> next_arrival() const;
  void run_free_until(Instant now);
  void lose_unseen(std::uint64_t frames);
  void expose(Instant begin, std::optional<std::uint64_t> pulse);
  void deliver_until(Instant now);
  void discard_waiting();

  ClockPort& clock_;
  SimTrigger& trigger_;
  HeadOptions options_;
  const HeadIdentity identity_;
  Random random_;
  HeadPicture picture_;
  Port* port_ = nullptr;
  bool present_ = true;
  std::optional<TriggerMode> mode_;  ///< empty: it does not stream
  DelayedSettings settings_;
  FreeRun free_run_;
  Cable cable_;
  Instant busy_until_;
  Instant last_received_;
  std::uint32_t sequence_ = 0;
  bool keep_sequence_ = false;        ///< set by the test before a start
  std::deque<ExposedFrame> exposed_;  ///< frames in the sensor or in transfer, sorted by arrival
  std::array<FrameTruth, 64> newest_{};
  HeadCounts counts_;
  double light_ = 1;
};

}  // namespace nodal::hal::sim
