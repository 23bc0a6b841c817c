// The event queue of the whole simulated world.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "protocol/base/units.h"

namespace nodal::swarm {

enum class EventKind : std::uint8_t {
  kPulse,   ///< the trigger sends its next pulse
  kExpose,  ///< a free-running head begins an exposure
  kArrive,  ///< a frame's last byte is in memory
  kStep,    ///< the rig is stepped
  kHost,    ///< a host acts
  kPlan,    ///< the next planned fault
};

struct Event {
  Instant at;
  std::uint64_t order = 0;  ///< events of the same time run in planning order
  EventKind kind = EventKind::kStep;
  std::uint8_t who = 0;
  std::uint32_t epoch = 0;  ///< epoch of the planner; events of an older one are ignored
};

/// Threading: thread-bound.
/// Ownership: none.
/// Errors: none.
class EventQueue {
 public:
  void plan(Instant at, EventKind kind, std::uint8_t who = 0, std::uint32_t epoch = 0) {
    heap_.push_back({at, next_order_++, kind, who, epoch});
    std::push_heap(heap_.begin(), heap_.end(), later);
  }
  /// Delays all events by `by`; their order stays.
  void shift(Duration by) {
    for (Event& event : heap_) event.at = event.at + by;
  }
  bool empty() const { return heap_.empty(); }
  Event next() {
    std::pop_heap(heap_.begin(), heap_.end(), later);
    const Event event = heap_.back();
    heap_.pop_back();
    return event;
  }

 private:
  static bool later(const Event& a, const Event& b) { return a.at != b.at ? a.at > b.at : a.order > b.order; }

  std::vector<Event> heap_;
  std::uint64_t next_order_ = 0;
};

}  // namespace nodal::swarm
