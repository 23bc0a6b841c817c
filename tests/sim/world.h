// Everything outside the rig: clock, heads, trigger, and the queue of what happens to them.
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
/// Ownership: owns the ports' other halves; the rig must be gone before it is.
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

  /// The rig's clock goes on at once; all that the world had planned comes that much later by it.
  void step_clock(Duration by);

  /// A physical event: true when a frame came to where the rig can find it, or a pulse was seen.
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
