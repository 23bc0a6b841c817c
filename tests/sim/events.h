// What happens next, in the whole simulated world: one queue.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "protocol/base/units.h"

namespace nodal::swarm {

enum class EventKind : std::uint8_t {
  kPulse,   ///< the trigger sends its next
  kExpose,  ///< a head in free run begins an exposure
  kArrive,  ///< a frame's last byte is in memory
  kStep,    ///< the rig looks round
  kHost,    ///< a host does something
  kPlan,    ///< the next of the faults that were drawn
};

struct Event {
  Instant at;
  std::uint64_t order = 0;  ///< of those at one moment, first planned is first
  EventKind kind = EventKind::kStep;
  std::uint8_t who = 0;
  std::uint32_t epoch = 0;  ///< of who planned it; an older one means nothing any more
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
  /// Everything is that much later; the order stays.
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
