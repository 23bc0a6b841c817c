// When the heads expose: by the trigger's pulses, or free-running and nudged into step.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>

#include "firmware/capture/capture_head.h"
#include "firmware/capture/set_timing.h"
#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "firmware/sync/aligner.h"
#include "firmware/sync/genlock.h"
#include "firmware/sync/set_clock.h"
#include "hal/head.h"
#include "hal/trigger.h"
#include "hal/wake_ups.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

struct GenlockStart {
  std::optional<FrameRate> rate;
  std::optional<Duration> pulse_width;
};

/// The genlock, the aligner of free-running heads and the clock of the sets always agree on the rate, and on whether
/// exposures follow pulses. When the heads change between pulses and free run, the open sets are closed first, because
/// their slots are those of the clock that ends.
///
/// Threading: thread-bound to capture.
/// Ownership: the trigger's port outlives it; it may be null.
/// Errors: start() returns the port's; the heads run free then.
class CapturePace {
 public:
  /// `close_sets`: closes all open sets.
  CapturePace(const RigConfig& config, hal::TriggerPort* trigger, std::function<void(Instant now)> close_sets);

  /// Without a trigger, free-running heads are aligned at the rate of rig.toml.
  Status start(const GenlockStart& start, Instant now);
  void stop(Instant now);
  /// Ends the pulses, when capture ends.
  void close() { genlock_.stop(); }
  /// Looks for overdue pulses and sets. Starts the genlock in the first step if rig.toml says so, and returns whether
  /// it did.
  bool step(Instant now);
  void add_wake_ups(hal::WakeUps& to) const { genlock_.add_wake_ups(to); }

  /// Reads the pulses that have come; true if there was one.
  bool take_edges(Instant now);
  /// The set of a frame. Nothing: the frame is older than every stored pulse.
  std::optional<SetClock::Match> match(std::size_t head, const hal::FrameView& frame, Instant now);
  /// The frame was put in a set; `starts`: how often its head was started.
  void on_frame(std::size_t head, const SetClock::Match& match, const hal::FrameView& frame, std::uint64_t starts);
  /// Fills in what the frames of a closed set say of its time.
  void describe(SetClock::Slot slot, FrameSet& set, const Skews& skews);
  /// The set was closed and described; `every_present`: it has a frame of every head that streams.
  void on_set(const FrameSet& set, const Skews& skews, bool every_present, Instant now);

  /// An exposure was requested: the next align() nudges for it, so that both take effect in the same frame.
  void align_soon() { align_now_ = true; }
  /// Nudges free-running heads, after every set and after every requested exposure.
  void align(std::deque<CaptureHead>& heads, Instant now);

  hal::TriggerMode mode() const { return mode_; }
  GenlockState state() const { return genlock_.state(); }
  const SetTiming& timing() const { return timing_; }
  std::optional<std::int32_t> free_drift_ppb(std::size_t head) const { return aligner_.drift_ppb(head); }
  GenlockReport report() const;

 private:
  bool pulsed() const { return genlock_.running() && !genlock_.aligning(); }
  void restart(hal::TriggerMode mode, FrameRate rate, Instant now);

  /// From rig.toml.
  struct Trigger {
    hal::TriggerSettings settings;
    SyncSource source{};
    bool start = false;  ///< the genlock starts with the rig, and was not started yet
  };
  Trigger trigger_;
  const std::function<void(Instant)> close_sets_;
  Genlock genlock_;
  Aligner aligner_;
  SetTiming timing_;
  hal::TriggerMode mode_ = hal::TriggerMode::kFreeRun;
  bool align_now_ = false;  ///< since the last align(), a set was closed or an exposure was requested
};

}  // namespace nodal::firmware
