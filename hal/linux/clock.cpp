#include "hal/linux/clock.h"

#include <ctime>

namespace nodal::hal::linux_os {

Instant LinuxClock::now() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return Instant::from_ns(std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec);
}

}  // namespace nodal::hal::linux_os
