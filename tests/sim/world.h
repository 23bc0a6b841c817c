// All parts outside the rig: clock, heads, trigger, and their event queue.
#pragma once

#include <memory>
#include <vector>

#include "hal/sim/clock.h"
#include "tests/sim/draw.h"
#include "tests/sim/events.h"
#include "tests/sim/head.h"
#include "tests/sim/trigger.h"

namespace nodal::swarm {

/// Threading: thread-bound.
/// Ownership: owns the ports' other halves; destroy the rig first.
/// Errors: none.
class World {
 public:
  explicit World(const Nature& nature);

  hal::sim::SimClock& clock() { return clock_; }
  Instant now() { return clock_.now(); }
  EventQueue& queue() { return queue_; }
  Trigger& trigger() { return trigger_; }
  hal::HeadEnumerator& enumerator() { return enumerator_; }
  Head& head(std::size_t i) { return *heads_[i]; }
  std::size_t heads() const { return heads_.size(); }

  /// The rig's clock jumps; all planned events move with it.
  void step_clock(Duration by);

  /// Handles a physical event; returns true if the rig can now find a frame or has detected a pulse.
  bool on_event(const Event& event);

 private:
  class Enumerator final : public hal::HeadEnumerator {
   public:
    explicit Enumerator(World& world) : world_(world) {}
    Result<std::unique_ptr<hal::HeadPort>> open(const std::string& path) override;
    std::vector<hal::HeadIdentity> list() override { return {}; }

   private:
    World& world_;
  };

  hal::sim::SimClock clock_;
  EventQueue queue_;
  std::vector<std::unique_ptr<Head>> heads_;
  Trigger trigger_;
  Enumerator enumerator_{*this};
};

}  // namespace nodal::swarm
