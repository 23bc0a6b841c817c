// The part of TakeKeeper that answers requests.
#include <utility>

#include "firmware/record/recording.h"
#include "firmware/record/take_keeper.h"
#include "protocol/base/try.h"

namespace nodal::firmware {

bool TakeKeeper::take_request(Instant now) {
  const auto request = mail_.next();
  if (!request) return false;
  auto done = run(*request, now);
  if (!done) mail_.answer(request->ticket, fail(done.error()));
  else if (*done) mail_.answer(request->ticket, std::move(**done));
  return true;
}

/// Nothing: the answer comes later.
Result<std::optional<TakeMailbox::Answered>> TakeKeeper::run(const TakeRequest& request, Instant now) {
  using Answered = TakeMailbox::Answered;
  const auto done = [](std::uint64_t take) { return std::optional<Answered>(TakeAnswer::Done{take}); };
  if (const auto* what = std::get_if<TakeRequest::Start>(&request.what)) {
    const bool recording = recording_ != nullptr;
    const auto take = start(*what, now);
    // A second press while a take is recorded is answered; the state of the rig is that it records.
    if (take || !recording) {
      report_.refused = take ? "" : "could not start a take: " + take.error().message;
      report_.has_room = take.has_value();  // until the next look
    }
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
    test_.end(fail(Errc::kCancelled, "the disk was ejected"));
    if (!ejecting_) ejecting_.emplace();
    ejecting_->take = 0;
    mail_.let_wait(ejecting_->tickets, request);
    if (recording_) recording_->end("ejected");
    return std::optional<Answered>();
  }
  if (const auto* what = std::get_if<TakeRequest::TestDisk>(&request.what)) {
    if (recording_) return fail(Errc::kBusy, "a take is being recorded; test the disk when none is");
    NODAL_TRY(test_.begin(request, *what, now));
    return std::optional<Answered>();
  }
  if (!recording_ || recording_->phase() != Recording::Phase::kRunning)
    return fail(Errc::kWrongState, "no take is being recorded; start one: nodal take start");
  if (const auto* what = std::get_if<TakeRequest::Mark>(&request.what)) {
    NODAL_TRY(recording_->mark(what->text, now));
    return done(recording_->number());
  }
  stopping_.push_back(request.ticket);
  recording_->end("stopped");
  return std::optional<Answered>();
}

/// Answers requests to eject when no take is recorded any more. While a file is being read, the next step tries again.
bool TakeKeeper::step_eject() {
  if (!ejecting_ || recording_) return false;
  const Status done = shelf_.ejected() ? Status() : shelf_.eject();
  if (!done && done.error().code == Errc::kBusy) return false;
  Eject eject = *std::exchange(ejecting_, std::nullopt);
  if (done) mail_.answer(eject.tickets, TakeAnswer::Done{eject.take});
  else mail_.answer(eject.tickets, fail(done.error()));
  return true;
}

}  // namespace nodal::firmware
