// The swarm's pulse generator: pulses are events, with every possible fault of a line.
#pragma once

#include <deque>
#include <functional>

#include "hal/sim/clock.h"
#include "hal/sim/scene/random.h"
#include "hal/trigger.h"
#include "tests/sim/events.h"
#include "tests/sim/stamp.h"

namespace nodal::swarm {

struct TriggerNature {
  Duration jitter;
  std::int64_t drift_ppb = 0;  ///< positive is slow
  Duration first_pulse = Duration::milliseconds(1);
};

/// Threading: thread-bound.
/// Ownership: refers to the clock and the queue.
/// Errors: as TriggerPort.
class Trigger final : public hal::TriggerPort {
 public:
  using Sink = std::function<void(PulseId, Instant)>;
  Trigger(hal::sim::SimClock& clock, EventQueue& queue, const TriggerNature& nature, std::uint64_t seed, Sink sink);

  // What the daemon uses.
  Status start(const hal::TriggerSettings& settings) override;
  void stop() override;
  Result<std::optional<hal::TriggerEdge>> take_edge() override;
  void add_wake_ups(hal::WakeUps&) const override {}  // the swarm's events decide when the rig steps
  void make_safe() noexcept override {}               // the swarm has one thread, so nothing can hang

  // What the swarm controls.
  void lose(int pulses) { lose_ += pulses; }             ///< not sent; their numbers are a gap
  void hide(int pulses) { hide_ += pulses; }             ///< sent, but not detected at the output
  void send_extra();                                     ///< an extra pulse on the line, now
  void set_drift(std::int64_t ppb);                      ///< from now on
  void shift(Duration by) { base_at_ = base_at_ + by; }  ///< the rig's clock jumped by that much
  void unplug() { gone_ = true; }
  void replug() { gone_ = false; }
  void forget_faults() { lose_ = hide_ = 0; }

  // What the swarm can query.
  bool running() const { return running_ && !gone_; }
  std::uint32_t epoch() const { return epoch_; }
  Duration period() const { return settings_.rate.period(); }
  Instant newest_seen() const { return newest_seen_; }  ///< pulse that was sent and detected; or the start

  void on_event(const Event& event);

 private:
  Instant planned(std::uint64_t number) const;

  hal::sim::SimClock& clock_;
  EventQueue& queue_;
  TriggerNature nature_;
  hal::sim::Random random_;
  Sink sink_;
  hal::TriggerSettings settings_;
  bool running_ = false;
  bool gone_ = false;
  std::uint32_t epoch_ = 0;
  std::uint64_t base_ = 0;  ///< next number at base_at_, when the drift last changed
  Instant base_at_;
  std::uint64_t next_ = 0;
  Instant newest_seen_;
  int lose_ = 0;
  int hide_ = 0;
  std::deque<hal::TriggerEdge> edges_;
};

}  // namespace nodal::swarm
