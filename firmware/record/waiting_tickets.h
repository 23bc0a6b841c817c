// Tickets of requests that wait for one end: of a test of the disk, of a take, of a read before an eject.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::firmware {

/// More than hosts that there may be, each with one such request. When more wait, some of their hosts are gone.
inline constexpr std::size_t kMaxWaitingTickets = 16;

/// Adds a ticket. Returns the oldest, removed, when there are too many; it is to be answered with too_many_wait().
inline std::optional<std::uint64_t> let_wait(std::vector<std::uint64_t>& tickets, std::uint64_t ticket) {
  tickets.push_back(ticket);
  if (tickets.size() <= kMaxWaitingTickets) return std::nullopt;
  const std::uint64_t oldest = tickets.front();
  tickets.erase(tickets.begin());
  return oldest;
}
inline Error too_many_wait() { return {Errc::kOverload, "too many hosts wait for the same; try again"}; }

}  // namespace nodal::firmware
