#include "firmware/record/take_mailbox.h"

#include <utility>

namespace nodal::firmware {

std::optional<TakeRequest> TakeMailbox::next() {
  for (std::size_t taken = 0; taken < requests_.capacity() && !answers_.full(); ++taken) {
    auto request = requests_.pop();
    if (!request || !request->host.gone()) return request;
    answer(request->ticket, fail(Presence::error()));
  }
  return std::nullopt;
}

void TakeMailbox::answer(std::uint64_t ticket, Result<Answered> result) {
  const bool pushed = answers_.push({ticket, std::move(result)});
  NODAL_ASSERT(pushed);  // it has room for all requests, and for all that wait
}

void TakeMailbox::answer(WaitingTickets& tickets, const Result<Answered>& result) {
  while (const auto ticket = tickets.next()) answer(*ticket, result);
}

void TakeMailbox::let_wait(WaitingTickets& tickets, const TakeRequest& request) {
  drop_gone(tickets);
  if (const auto oldest = tickets.add(request.ticket, request.host)) answer(*oldest, fail(WaitingTickets::too_many()));
}

bool TakeMailbox::drop_gone(WaitingTickets& tickets) {
  bool any = false;
  for (auto gone = tickets.next_gone(); gone; gone = tickets.next_gone(), any = true)
    answer(*gone, fail(Presence::error()));
  return any;
}

}  // namespace nodal::firmware
