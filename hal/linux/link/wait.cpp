#include "hal/linux/link/wait.h"

#include <poll.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <optional>

namespace nodal::hal {

bool wait_for(const WakeUps& wake_ups, Instant now, Duration at_most) {
  std::array<pollfd, WakeUps::kMax> polled{};
  nfds_t count = 0;
  for (const WakeUps::Descriptor& each : wake_ups.descriptors()) {
    polled[count].fd = each.number;
    polled[count++].events = static_cast<short>((each.readable ? POLLIN : 0) | (each.writable ? POLLOUT : 0));
  }
  Duration left = std::max(at_most, Duration());
  if (const auto at = wake_ups.at()) left = *at <= now ? Duration() : std::min(left, *at - now);
  constexpr std::int64_t kSecond = 1'000'000'000;
  const timespec timeout{left.ns() / kSecond, left.ns() % kSecond};
  const int woken = ::ppoll(polled.data(), count, &timeout, nullptr);
  for (nfds_t i = 0; i < count; ++i) {
    std::optional<bool>* const ready = wake_ups.descriptors()[i].ready;
    if (ready != nullptr && woken >= 0) *ready = polled[i].revents != 0;
  }
  return woken > 0;
}

}  // namespace nodal::hal
