// What the times of exposures say: which set a frame is of, when a set was exposed, how fast clocks run.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "firmware/sync/drift.h"
#include "firmware/sync/genlock.h"
#include "firmware/sync/pulse_watch.h"
#include "firmware/sync/rate_in_force.h"
#include "firmware/sync/set_clock.h"
#include "hal/head.h"
#include "hal/trigger.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// Threading: thread-bound to capture.
/// Ownership: none.
/// Errors: none.
class SetTiming {
 public:
  explicit SetTiming(const RigConfig& config);

  /// Heads were restarted, at this rate, with or without pulses.
  void restart(FrameRate rate, bool genlocked, Instant now);
  void on_edge(const hal::TriggerEdge& edge);

  /// Nothing: the frame is older than every stored pulse.
  std::optional<SetClock::Match> match(std::size_t head, const hal::FrameView& frame);
  /// The frame was put in a set.
  void add_pulsed(std::size_t head, const SetClock::Match& match, const hal::FrameView& frame);
  void add_free(std::size_t head, const SetClock::Match& match, const hal::FrameView& frame);
  /// Fills in what the set's frames say of its time. `pulsed`: exposures follow pulses.
  void describe(FrameSet& set, const Skews& skews, bool pulsed);
  /// The set was closed.
  void follow(SetClock::Slot slot, const FrameSet& set) { clock_.follow(slot, set.mid_exposure); }

  Duration period() const { return clock_.period(); }
  Instant middle_of(SetClock::Slot slot) const { return clock_.middle_of(slot); }
  /// rig.toml's rate, not that of a genlock that a host started.
  FrameRate configured() const { return rate_; }
  /// The rate at which sets come.
  FrameRate rate() const { return set_rate_.rate(); }
  /// The drift of the pulses if there are pulses; otherwise the median of the heads' drifts.
  std::optional<std::int32_t> drift_ppb(bool pulsed) const;
  /// Adds the state of each wired head.
  void report_wired(GenlockReport& report) const;

 private:
  struct Wiring {
    bool wired = false;
    Duration delay;  ///< from the trigger to the head's exposure
  };
  const FrameRate rate_;  ///< from rig.toml
  std::array<Wiring, kMaxHeads> wiring_{};
  SetClock clock_;
  DriftMeter pulse_drift_;
  std::array<DriftMeter, kMaxHeads> head_drift_;
  /// Phase and drift of each wired head's exposures; unused for other heads.
  std::array<PulseWatch, kMaxHeads> pulse_watch_;
  RateInForce set_rate_;
};

}  // namespace nodal::firmware
