#include "hal/sim/clock.h"

#include <ctime>

#include "protocol/base/result.h"

namespace nodal::hal::sim {

Instant SimClock::now() {
  if (!real_) return Instant::from_ns(now_ns_.load(std::memory_order_acquire));
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return Instant::from_ns(std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec);
}

void SimClock::advance_to(Instant at) {
  NODAL_ASSERT(!real_);
  NODAL_ASSERT(at.ns() >= now_ns_.load(std::memory_order_relaxed));
  now_ns_.store(at.ns(), std::memory_order_release);
}

}  // namespace nodal::hal::sim
