// The simulated pulse generator: it drives the trigger inputs of the rig's heads.
#pragma once

#include <array>
#include <atomic>
#include <deque>
#include <optional>

#include "hal/clock.h"
#include "hal/sim/scene/random.h"
#include "hal/trigger.h"

namespace nodal::hal::sim {

/// Receives the pulses.
class PulseSink {
 public:
  virtual ~PulseSink() = default;
  /// The active edge of pulse `number`; calls are in order of time.
  virtual void on_pulse(std::uint64_t number, Instant at) = 0;
  /// `pulses` pulses came during a pause longer than kEdgesKept; their frames are lost.
  virtual void on_unseen(std::uint64_t pulses) = 0;
};

struct TriggerOptions {
  Duration jitter;             ///< per pulse, uniform in both directions; at most a quarter period
  std::int64_t drift_ppb = 0;  ///< drift of the generator's crystal: positive is slow; at most 10^8 either way
  Duration first_pulse = Duration::milliseconds(1);  ///< from start() to pulse 0
  FrameRate fastest{1000, 1};
  std::optional<FrameRate> external;  ///< another device drives the line at this rate since the rig's first second
};

/// Threading: thread-bound to capture, with the heads of its rig.
/// Ownership: none; refers to the clock and the sinks.
/// Errors: as TriggerPort.
class SimTrigger final : public TriggerPort {
 public:
  /// The most edges that wait to be taken, and pulses that one step sends: eight seconds of NTSC.
  static constexpr std::size_t kEdgesKept = 256;

  SimTrigger(ClockPort& clock, const TriggerOptions& options, std::uint64_t seed);

  // What the daemon uses.
  Status start(const TriggerSettings& settings) override;
  void stop() override;
  Result<std::optional<TriggerEdge>> take_edge() override;
  void add_wake_ups(WakeUps& to) const override {
    if (const auto next = next_pulse()) to.at(*next);
  }
  void make_safe() noexcept override { safe_.store(true); }

  // What the test uses.
  void lose_pulse() { ++pulses_to_lose_; }
  void unplug() { gone_ = true; }
  bool running() const { return running_ && !safe_.load(); }
  std::uint64_t pulses_sent() const { return sent_; }
  std::uint64_t edges_forgotten() const { return forgotten_; }  ///< dropped because they were not taken in time

  // What the rig uses.
  void connect(HeadIndex head, PulseSink* sink) { sinks_[head] = sink; }
  /// Nothing while it does not run.
  std::optional<Instant> next_pulse() const { return running() && !gone_ ? std::optional(next_at_) : std::nullopt; }
  /// Sends every pulse due up to `now`; of those between the oldest and the newest kEdgesKept it sends only the count.
  void step(Instant now);

 private:
  Status check_present() const;
  Status check(const TriggerSettings& settings) const;
  void skip_to(Instant now);
  Instant planned(std::uint64_t number) const;
  void send(std::uint64_t number, Instant at);

  ClockPort& clock_;
  const TriggerOptions options_;
  Random random_;
  std::array<PulseSink*, kMaxHeads> sinks_{};
  TriggerSettings settings_;
  bool running_ = false;
  bool gone_ = false;
  std::atomic<bool> safe_{false};  ///< permanently
  Instant started_;                ///< moment of pulse 0
  FrameRate rate_;                 ///< rate of the device that drives the line
  std::uint64_t next_ = 0;
  Instant next_at_;
  std::uint64_t sent_ = 0;
  std::uint64_t forgotten_ = 0;
  std::uint32_t pulses_to_lose_ = 0;
  std::deque<TriggerEdge> edges_;
};

}  // namespace nodal::hal::sim
