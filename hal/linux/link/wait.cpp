#include "hal/linux/link/wait.h"

#include <poll.h>

#include <algorithm>
#include <array>
#include <ctime>

namespace nodal::hal {

bool wait_for(const WakeUps& wake_ups, Instant now, Duration at_most) {
  std::array<pollfd, WakeUps::kMost> polled{};
  nfds_t count = 0;
  for (const WakeUps::Descriptor& each : wake_ups.descriptors()) {
    polled[count].fd = each.number;
    polled[count++].events = static_cast<short>((each.readable ? POLLIN : 0) | (each.writable ? POLLOUT : 0));
  }
  Duration left = std::max(at_most, Duration());
  if (const auto at = wake_ups.at()) left = *at <= now ? Duration() : std::min(left, *at - now);
  constexpr std::int64_t kSecond = 1'000'000'000;
  const timespec timeout{left.ns() / kSecond, left.ns() % kSecond};
  return ::ppoll(polled.data(), count, &timeout, nullptr) > 0;
}

}  // namespace nodal::hal
