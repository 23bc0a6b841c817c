// The part of TakeKeeper that answers requests.
#include <utility>

#include "firmware/record/take_keeper.h"
#include "firmware/record/take_writer.h"
#include "protocol/base/try.h"
#include "protocol/take/documents.h"

namespace nodal::firmware {

bool TakeKeeper::take_request(Instant now) {
  const auto request = next_request();
  if (!request) return false;
  auto done = run(*request, now);
  if (!done) answer(request->ticket, fail(done.error()));
  else if (*done) answer(request->ticket, std::move(**done));
  return true;
}

/// The oldest request of a host that is still there, and of the rig itself. Those before it are dropped.
std::optional<TakeRequest> TakeKeeper::next_request() {
  for (std::size_t taken = 0; taken < requests_.capacity() && !answers_.full(); ++taken) {
    auto request = requests_.pop();
    if (!request || !request->host.gone()) return request;
    answer(request->ticket, fail(Presence::error()));
  }
  return std::nullopt;
}

void TakeKeeper::let_wait(WaitingTickets& tickets, const TakeRequest& request) {
  drop_gone(tickets);
  if (const auto oldest = tickets.add(request.ticket, request.host)) answer(*oldest, fail(WaitingTickets::too_many()));
}

/// True when there was one.
bool TakeKeeper::drop_gone(WaitingTickets& tickets) {
  bool any = false;
  for (auto gone = tickets.next_gone(); gone; gone = tickets.next_gone(), any = true)
    answer(*gone, fail(Presence::error()));
  return any;
}

/// Nothing: the answer comes later.
Result<std::optional<TakeKeeper::Answered>> TakeKeeper::run(const TakeRequest& request, Instant now) {
  const auto done = [](std::uint64_t take) { return std::optional<Answered>(TakeAnswer::Done{take}); };
  if (const auto* what = std::get_if<TakeRequest::Start>(&request.what)) {
    const auto take = start(*what, now);
    report_.refused = take ? "" : "no take began: " + take.error().message;
    report_.has_room = take.has_value();  // until the next look
    if (!take) return fail(take.error());
    if (!what->still) return done(*take);
    stopping_.push_back(request.ticket);
    return std::optional<Answered>();
  }
  if (std::holds_alternative<TakeRequest::List>(request.what)) {
    NODAL_TRY(shelf_.refresh());
    TakeAnswer::Listed listed;
    for (const auto& [number, entry] : shelf_.takes()) listed.takes.push_back(entry);
    return std::optional<Answered>(std::move(listed));
  }
  if (const auto* what = std::get_if<TakeRequest::Delete>(&request.what)) {
    NODAL_TRY(shelf_.remove(what->take, what->manifest));
    return done(what->take);
  }
  if (const auto* what = std::get_if<TakeRequest::Protect>(&request.what)) {
    NODAL_TRY(shelf_.protect(what->take, what->on));
    return done(what->take);
  }
  if (std::holds_alternative<TakeRequest::Eject>(request.what)) {
    if (test_) end_test(fail(Errc::kCancelled, "the disk was ejected"));
    ejected_take_ = 0;
    ejecting_ = true;
    let_wait(ejects_, request);
    if (writing_) tell_to_end("ejected");
    return std::optional<Answered>();
  }
  if (const auto* what = std::get_if<TakeRequest::TestDisk>(&request.what)) {
    NODAL_TRY(begin_test(request, *what, now));
    return std::optional<Answered>();
  }
  if (!writing_ || ending_) return fail(Errc::kWrongState, "no take is being recorded; start one: nodal take start");
  if (const auto* what = std::get_if<TakeRequest::Mark>(&request.what)) {
    NODAL_TRY(writing_->mark(what->text, now));
    return done(writing_->number());
  }
  stopping_.push_back(request.ticket);
  tell_to_end("stopped");
  return std::optional<Answered>();
}

void TakeKeeper::answer_end(std::uint64_t take, const Result<take::Manifest>& manifest, bool empty_still) {
  for (const std::uint64_t ticket : std::exchange(stopping_, {})) {
    if (empty_still) answer(ticket, fail(Errc::kNotReady, "no set came; `nodal status` says why"));
    else if (manifest) answer(ticket, TakeAnswer::Done{take});
    else answer(ticket, fail(manifest.error()));
  }
  if (manifest) {
    ejected_take_ = take;
    return;
  }
  ejecting_ = false;
  while (const auto ticket = ejects_.next()) answer(*ticket, fail(manifest.error()));
}

/// Answers requests to eject when no take is recorded any more. While a file is being read, the next step tries again.
bool TakeKeeper::step_eject() {
  if (!ejecting_ || writing_) return false;
  const Status done = shelf_.ejected() ? Status() : shelf_.eject();
  if (!done && done.error().code == Errc::kBusy) return false;
  const std::uint64_t take = std::exchange(ejected_take_, 0);
  ejecting_ = false;
  while (const auto ticket = ejects_.next()) {
    if (done) answer(*ticket, TakeAnswer::Done{take});
    else answer(*ticket, fail(done.error()));
  }
  return true;
}

}  // namespace nodal::firmware
