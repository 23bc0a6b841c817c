// The trigger on GPIO lines: pulses that a thread sends, or those of another device.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "hal/linux/gpio/edge_log.h"
#include "hal/linux/gpio/event_reader.h"
#include "hal/linux/gpio/output_line.h"
#include "hal/linux/gpio/pulse_train.h"
#include "hal/linux/gpio/read_back.h"
#include "hal/linux/gpio/sync_input.h"
#include "hal/linux/gpio/system.h"
#include "hal/trigger.h"

namespace nodal::hal::gpio {

/// The lines of a trigger. Either outputs or an input, or both.
struct TriggerLines {
  struct Output {
    LineName line;
    std::vector<HeadIndex> heads;  ///< wired to this line; their delays must be equal
  };
  std::vector<Output> outputs;
  std::optional<LineName> read_back;  ///< an input that is wired to the first output
  std::optional<LineName> input;      ///< to follow another device
  Bias input_bias = Bias::kAsIs;
  bool active_high = true;
};

/// A thread sends the pulses; capture's thread takes what it logged, and reads the input lines, whose kernel timestamps
/// do not depend on when they are read. start() and stop() only hand a train to the thread, so a line that hangs delays
/// no frame.
///
/// Threading: thread-bound to capture; make_safe() from any thread.
/// Ownership: the system outlives it.
/// Errors: as TriggerPort. kDeviceFailed when a line refuses five writes in a row; start() tries again.
class GpioTrigger final : public TriggerPort {
 public:
  /// Claims the lines, outputs at their inactive level, which may take long; and starts the thread. Errors: a line that
  /// cannot be claimed; kOverload when the system refuses the thread.
  static Result<std::unique_ptr<GpioTrigger>> open(System& system, TriggerLines lines);
  ~GpioTrigger() override;

  Status start(const TriggerSettings& settings) override;
  void stop() override;
  Result<std::optional<TriggerEdge>> take_edge() override;
  /// The input lines. Pulses that the thread sends wait in its log for the frames that they expose.
  void add_wake_ups(WakeUps& to) const override;
  TriggerCounts counts() const override;
  void make_safe() noexcept override;

  /// Why the thread has no real-time priority; empty when it has.
  const std::string& notice() const { return notice_; }
  /// The longest delay of a pulse after its time, as the thread measured it.
  Duration latest() const { return Duration::nanoseconds(pulses_.counts().latest_ns.load()); }

 private:
  GpioTrigger(System& system, TriggerLines lines);
  Status claim();
  Status run();
  Status check_present() const;
  Status check(const TriggerSettings& settings) const;
  Status check_delays(const TriggerSettings& settings) const;
  void post(Train train);
  Instant step(Instant now);
  Result<std::optional<TriggerEdge>> take_sent();
  Result<std::optional<TriggerEdge>> take_followed();

  System& system_;
  const TriggerLines lines_;
  const std::string who_;  ///< the trigger's name in messages
  std::vector<std::unique_ptr<OutputLine>> outputs_;
  std::optional<EventReader> input_, read_back_line_;
  EdgeLog log_;
  PulseTrain pulses_;
  std::atomic<bool> safe_{false};

  // Handed to the thread. The lock is held for a copy, never for a write.
  std::mutex mutex_;
  Train posted_train_;
  std::atomic<bool> posted_{false};

  // Capture's.
  std::uint32_t id_ = 0;  ///< number of the newest train
  bool running_ = false;
  bool following_ = false;
  SyncInput sync_;
  ReadBack read_back_;
  Duration read_back_delay_;  ///< delay of the first output after the trigger

  std::string notice_;
  std::unique_ptr<Runner> runner_;
};

}  // namespace nodal::hal::gpio
