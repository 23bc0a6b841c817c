// The requests that the takes' stage gets, and its answers to them.
#pragma once

#include <cstdint>
#include <optional>
#include <variant>

#include "firmware/record/take_messages.h"
#include "firmware/record/waiting_tickets.h"
#include "protocol/base/result.h"
#include "protocol/base/spsc_ring.h"

namespace nodal::firmware {

/// Every request is answered once. It may wait in a WaitingTickets before; that of a host that has gone is dropped.
///
/// Threading: requests() and answers() are SPSC rings with control; the rest is thread-bound to the takes' stage.
/// Ownership: none.
/// Errors: none.
class TakeMailbox {
 public:
  using Answered = std::variant<TakeAnswer::Listed, TakeAnswer::Done, TakeAnswer::DiskTested>;

  SpscRing<TakeRequest>& requests() { return requests_; }
  SpscRing<TakeAnswer>& answers() { return answers_; }

  /// The oldest request of a host that is still there, or of the rig itself. Those before it are dropped.
  std::optional<TakeRequest> next();
  void answer(std::uint64_t ticket, Result<Answered> result);
  /// Gives all that wait the same answer.
  void answer(WaitingTickets& tickets, const Result<Answered>& result);
  void let_wait(WaitingTickets& tickets, const TakeRequest& request);
  /// True when a host that waited has gone.
  bool drop_gone(WaitingTickets& tickets);

 private:
  static constexpr std::size_t kRequests = 64;

  SpscRing<TakeRequest> requests_{kRequests};
  SpscRing<TakeAnswer> answers_{kRequests + 3 * kMaxWaitingTickets};
};

}  // namespace nodal::firmware
