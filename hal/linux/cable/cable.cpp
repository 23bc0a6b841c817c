#include "hal/linux/cable/cable.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace nodal::hal::cable {
namespace {

constexpr const char* kUnplugged = "the cable was unplugged, or the host reset the rig's USB device";

std::uint16_t on_the_wire(std::uint64_t session) { return static_cast<std::uint16_t>(session & 0xffff); }

}  // namespace

Cable::Cable(std::unique_ptr<UsbFunction> function, std::string name)
    : function_(std::move(function)),
      name_(std::move(name)),
      why_("no host has opened the cable"),
      received_([this](std::size_t slot) {
        const bool queued = function_->queue_read(slot);
        if (!queued) end_session(kUnplugged);
        return queued;
      }) {}

Cable::~Cable() {
  close(session_);
  using Clock = std::chrono::steady_clock;
  const auto until = Clock::now() + std::chrono::nanoseconds(kFarewell.ns());
  while (!broken_ && !why_ && (writes_queued_ > 0 || last_record_due_) && Clock::now() < until) {
    function_->wait(Duration::milliseconds(10));
    pump();
  }
}

Result<std::optional<std::uint64_t>> Cable::take_session() {
  pump();
  if (broken_) return fail(*broken_);
  if (std::exchange(handed_out_, true)) return std::nullopt;
  return session_;
}

Result<std::size_t> Cable::read(std::uint64_t session, std::span<std::uint8_t> into) {
  if (into.empty()) return 0;
  pump();
  if (session != session_) return closed(session);
  std::size_t n = 0;
  while (n < into.size()) {
    const auto part = received_.next_bytes(into.size() - n);
    if (part.empty()) break;
    std::copy(part.begin(), part.end(), into.begin() + static_cast<std::ptrdiff_t>(n));
    n += part.size();
  }
  if (n == 0 && over()) return closed(session);
  return n;
}

Result<std::size_t> Cable::write(std::uint64_t session, std::span<const std::uint8_t> from) {
  if (from.empty()) return 0;
  pump();
  if (session != session_) return closed(session);
  received_.advance();
  if (over()) return closed(session);
  std::size_t n = 0;
  while (n < from.size()) {
    const std::size_t taken = queue_record(from.subspan(n));
    if (taken == 0) break;
    n += taken;
  }
  return n;
}

void Cable::add_wake_ups(std::uint64_t session, WakeUps& to, bool to_read, bool to_write) const {
  const bool ended = session != session_ || over();
  if ((to_read && (ended || received_.ready())) || (to_write && (ended || writes_queued_ < kTransfers)))
    to.at(Instant());
  to.on({function_->descriptor(), to_read || to_write, false});
}

void Cable::add_wake_ups(WakeUps& to) const {
  if (!handed_out_) to.at(Instant());
  to.on({function_->descriptor(), true, false});
}

void Cable::close(std::uint64_t session) {
  if (session != session_ || abandoned_) return;
  abandoned_ = true;
  last_record_due_ = !over();
  pump();
}

void Cable::pump() {
  // Completions first: bytes that arrived before the cable was unplugged are still read.
  while (const auto completion = function_->next_completion()) complete(*completion);
  for (int i = 0; i < kEventsAPump && !broken_; ++i) {
    const auto event = function_->next_event();
    if (!event) {
      broken_ = event.error();
    } else if (*event) {
      handle(**event);
    } else {
      break;
    }
  }
  while (const auto completion = function_->next_completion()) complete(*completion);
  if (opening_ && received_.queued() + writes_queued_ == 0) begin_session();
  if (!abandoned_) return;
  // What the host still sends is read and dropped, or it would wait for this end until it gives up.
  while (!received_.next_bytes(kTransferBytes).empty()) {}
  if (last_record_due_ && !why_ && writes_queued_ < kTransfers) {
    queue_record({});
    last_record_due_ = false;
  }
}

void Cable::handle(const FunctionEvent& event) {
  switch (event.kind) {
    case FunctionEvent::Kind::kDisabled:
      opening_ = false;
      end_session(kUnplugged);
      return;
    case FunctionEvent::Kind::kSetup: break;
    case FunctionEvent::Kind::kEnabled:
    case FunctionEvent::Kind::kOther: return;
  }
  opening_ = false;  // the host has given up a request before this one
  const Setup& setup = event.setup;
  if (setup.type != kOpenRequestType || setup.request != kOpenRequest || setup.length < kAnswerBytes) {
    function_->refuse(setup);
  } else if (setup.value != kVersion) {
    function_->answer(write_answer({kVersion, 0}));
  } else {
    end_session("another host opened the cable");
    function_->cancel_all();
    opening_ = true;
  }
}

void Cable::complete(const Completion& completion) {
  if (completion.direction == Direction::kToHost) {
    writing_[completion.slot] = false;
    --writes_queued_;
  } else {
    const auto bytes = static_cast<std::size_t>(std::clamp<std::int64_t>(completion.result, 0, kTransferBytes));
    received_.received(completion.slot, function_->buffer(Direction::kFromHost, completion.slot).first(bytes));
  }
  if (completion.result < 0) end_session(kUnplugged);
}

void Cable::end_session(const std::string& why) {
  if (!why_) why_ = why;
  received_.stop();
}

void Cable::begin_session() {
  opening_ = false;
  ++session_;
  handed_out_ = false;
  abandoned_ = false;
  last_record_due_ = false;
  why_.reset();
  received_.begin(on_the_wire(session_));
  function_->answer(write_answer({kVersion, on_the_wire(session_)}));
}

std::size_t Cable::queue_record(std::span<const std::uint8_t> payload) {
  const auto free = std::find(writing_.begin(), writing_.end(), false);
  if (free == writing_.end()) return 0;
  const auto slot = static_cast<std::size_t>(free - writing_.begin());
  const WrittenRecord record =
      write_record(on_the_wire(session_), payload, function_->buffer(Direction::kToHost, slot));
  if (!function_->queue_write(slot, record.transfer)) {
    end_session(kUnplugged);
    return 0;
  }
  *free = true;
  ++writes_queued_;
  return record.payload;
}

tl::unexpected<Error> Cable::closed(std::uint64_t session) const {
  if (session != session_) return fail(Errc::kLinkClosed, name_ + ": another host opened the cable");
  if (received_.violation()) return fail(received_.violation()->in(name_));
  if (broken_) return fail(Errc::kLinkClosed, broken_->message);
  return fail(Errc::kLinkClosed, name_ + ": " + (why_ ? *why_ : "the host closed the link"));
}

}  // namespace nodal::hal::cable
