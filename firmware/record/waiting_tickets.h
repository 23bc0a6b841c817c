// Requests of hosts that wait for one end: of a test of the disk, of a read before an eject.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "firmware/frame/presence.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// As many as there may be links of hosts that may make such a request; each has one request at a time.
inline constexpr std::size_t kMaxWaitingTickets = 32;

/// Threading: thread-bound.
/// Ownership: none.
/// Errors: none.
class WaitingTickets {
 public:
  /// Returns the oldest, removed, when there are more than kMaxWaitingTickets; it is to be answered with too_many().
  std::optional<std::uint64_t> add(std::uint64_t ticket, Presence host) {
    waiting_.push_back({ticket, std::move(host)});
    if (waiting_.size() <= kMaxWaitingTickets) return std::nullopt;
    return take(waiting_.begin());
  }
  /// A ticket whose host has gone, removed; it is to be answered with Presence::error().
  std::optional<std::uint64_t> next_gone() {
    for (auto each = waiting_.begin(); each != waiting_.end(); ++each) {
      if (each->host.gone()) return take(each);
    }
    return std::nullopt;
  }
  /// The oldest, removed.
  std::optional<std::uint64_t> next() {
    if (waiting_.empty()) return std::nullopt;
    return take(waiting_.begin());
  }
  bool empty() const { return waiting_.empty(); }

  static Error too_many() { return {Errc::kOverload, "too many hosts wait for the same; try again"}; }

 private:
  struct Waiting {
    std::uint64_t ticket = 0;
    Presence host;
  };
  std::uint64_t take(std::vector<Waiting>::iterator which) {
    const std::uint64_t ticket = which->ticket;
    waiting_.erase(which);
    return ticket;
  }

  std::vector<Waiting> waiting_;
};

}  // namespace nodal::firmware
