#include "host_tool/rig/rig_connection.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "hal/linux/cable/host/cable_link.h"
#include "hal/linux/link/socket_link.h"
#include "hal/linux/link/wait.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/quantities.h"
#include "host_tool/rig/rig_input.h"
#include "protocol/base/try.h"
#include "protocol/base/version.h"

namespace nodal::host {
namespace {

constexpr Duration kLookEvery = Duration::seconds(1);
constexpr Duration kLookForCtrlCEvery = Duration::milliseconds(250);
constexpr std::string_view kSoftware = "nodal " NODAL_VERSION;

tl::unexpected<Error> cancelled() { return fail(Errc::kCancelled, "stopped by " + interrupt_name()); }

/// The link's error, and how to reach a rig in another way.
tl::unexpected<Error> no_rig(const RigAddress& address, const Error& error) {
  if (address.command.empty()) {
    return fail(error.code, fmt::format("{} (--rig or NODAL_RIG say where else to look)", error.message));
  }
  return fail(Errc::kUnreachable, fmt::format("no rig at {}: {}; does `{}` work when you run it yourself?",
                                              address.text, error.message, fmt::join(address.command, " ")));
}

}  // namespace

Duration steady_now() {
  using namespace std::chrono;
  return Duration::nanoseconds(duration_cast<nanoseconds>(steady_clock::now().time_since_epoch()).count());
}

Result<std::unique_ptr<hal::LinkPort>> open_link(const RigAddress& address) {
  constexpr std::string_view kUsb = "usb:";
  if (!address.command.empty()) return hal::spawn_link(address.command);
  if (address.link.starts_with(kUsb)) return hal::cable::connect_cable(address.link.substr(kUsb.size()));
  return hal::connect_link(address.link);
}

void wait_by_poll(hal::LinkPort& link, bool to_write, Duration at_most) {
  hal::WakeUps wake_ups;
  link.add_wake_ups(wake_ups, true, to_write);
  hal::wait_for(wake_ups, Instant(),
                std::min(at_most, kLookForCtrlCEvery));  // a signal: the caller checks interrupted()
}

Result<std::unique_ptr<RigConnection>> RigConnection::open(const RigAddress& address, Duration patience,
                                                           const OpenLink& open) {
  Result<std::unique_ptr<hal::LinkPort>> link = open(address);
  if (!link) return no_rig(address, link.error());
  auto connection = over(std::move(*link), address.text, patience, wait_by_poll);
  if (!connection && connection.error().code == Errc::kLinkClosed) {
    const std::string why =
        address.command.empty() ? address.text + ": " + connection.error().message : connection.error().message;
    return no_rig(address, Error{Errc::kUnreachable, why});
  }
  return connection;
}

Result<std::unique_ptr<RigConnection>> RigConnection::over(std::unique_ptr<hal::LinkPort> link, std::string address,
                                                           Duration patience, WaitForLink wait, HostClock clock) {
  std::unique_ptr<RigConnection> connection(
      new RigConnection(std::move(link), std::move(address), patience, std::move(wait), std::move(clock)));
  NODAL_TRY(connection->say_hello());
  return connection;
}

RigConnection::RigConnection(std::unique_ptr<hal::LinkPort> link, std::string address, Duration patience,
                             WaitForLink wait, HostClock clock)
    : link_(std::move(link)),
      address_(std::move(address)),
      patience_(patience),
      wait_(std::move(wait)),
      clock_(std::move(clock)),
      session_(Role::kHost, make_hello(std::string(kSoftware))),
      received_at_(now()),
      quiet_(patience / 4, received_at_, kMinBytesAWindow / 4),
      probed_(patience - patience / 4, received_at_, kMinBytesAWindow - kMinBytesAWindow / 4) {}

Status RigConnection::say_hello() {
  NODAL_TRY(step_until([this] { return session_.peer_hello() != nullptr; }, "the rig's hello", patience_));
  std::optional<Event> hello = session_.next_event();  // always the first event
  rig_ = std::get<wire::Hello>(std::move(*hello));
  return check_and_clean(rig_);
}

Result<std::uint64_t> RigConnection::post(wire::Request& request) {
  if (dead_) return fail(*dead_);
  request.set_id(next_request_++);
  NODAL_TRY(session_.send(request));
  questions_[request.id()];
  return request.id();
}

void RigConnection::sort_answers() {
  while (std::optional<wire::Reply> reply = session_.take_reply()) {
    if (reply->id() == probe_) probe_.reset();
    quiet_.restart(now());
    const auto question = questions_.find(reply->id());
    if (question != questions_.end() && !question->second) question->second = std::move(*reply);
  }
}

Result<wire::Reply> RigConnection::take_answer(std::uint64_t id) {
  wire::Reply reply = std::move(*questions_.at(id));
  questions_.erase(id);
  if (const Status good = check_and_clean(reply); !good) return fail(good.error().in(address_));
  if (!reply.has_error()) return reply;
  return fail(static_cast<Errc>(std::min<std::uint32_t>(reply.error().code(), UINT16_MAX)), reply.error().message());
}

Result<wire::Reply> RigConnection::ask(wire::Request request) {
  NODAL_TRY_ASSIGN(const std::uint64_t id, post(request));
  const Status waited = step_until([&] { return answered(id); }, "an answer", patience_);
  if (answered(id)) return take_answer(id);  // the answer may have arrived together with the rig's Bye
  questions_.erase(id);
  return fail(waited.error());
}

Result<wire::Reply> RigConnection::ask_long(wire::Request request,
                                            const std::function<void(const wire::RigStatus&)>& meanwhile) {
  NODAL_TRY_ASSIGN(const std::uint64_t id, post(request));
  ActivityFloor floor(now());
  while (true) {
    const Status waited = step_until([&] { return answered(id); }, "an answer", std::min(kLookEvery, patience_));
    if (answered(id)) return take_answer(id);
    if (waited.error().code != Errc::kTimeout) return fail(waited.error());
    wire::Request status;
    status.mutable_status();
    NODAL_TRY_ASSIGN(const wire::Reply how, ask(status));
    floor.see(how.status().activity(), now());
    if (floor.stalled(now())) {
      questions_.erase(id);
      return fail(
          Errc::kTimeout,
          fmt::format("{}: the rig has not finished within {} and makes no progress; `nodal status` says what it "
                      "is doing",
                      address_, show_duration(static_cast<std::uint64_t>(floor.since_begun(now()).ns()))));
    }
    meanwhile(how.status());
  }
}

Status RigConnection::check_alive() {
  const Duration at = now();
  if (!probe_) {
    if (at - received_at_ < patience_ / 4 && !quiet_.stalled(at)) return {};
    wire::Request status;
    status.mutable_status();
    status.set_id(next_request_++);
    NODAL_TRY(session_.send(status));
    probe_ = status.id();
    probed_.restart(at);  // counts from the probe: this program may have been stopped for a while
    return {};
  }
  if (!probed_.stalled(at)) return {};
  const std::string silent = show_duration(static_cast<std::uint64_t>((at - received_at_).ns()));
  const bool trickles = at - received_at_ < probed_.window();
  return fail(
      Errc::kTimeout,
      fmt::format("{}: {}; it hangs, or the link to it is stuck (--timeout waits longer)", address_,
                  trickles ? "the rig sends bytes, but too few to answer" : "the rig has sent nothing for " + silent));
}

Result<std::optional<Event>> RigConnection::next_event(Duration at_most) {
  const Duration until = now() + at_most;
  while (true) {
    if (interrupted()) return cancelled();
    sort_answers();
    // One event at a time: the session grants the rig credit only for events that were taken.
    if (std::optional<Event> event = session_.next_event()) {
      quiet_.restart(now());
      probed_.restart(now());
      return event;
    }
    const Duration left = until - now();
    if (left < Duration()) return std::nullopt;
    NODAL_TRY(check_alive());
    NODAL_TRY(step(left));
  }
}

Result<std::optional<Event>> RigConnection::next_event_of(StreamId stream, Duration at_most) {
  const Duration until = now() + at_most;
  while (true) {
    Result<std::optional<Event>> event = next_event(std::max(Duration(), until - now()));
    if (!event || !*event) return event;
    const bool wanted = std::visit(
        [stream](const auto& it) {
          if constexpr (requires { it.stream; }) return it.stream == stream;
          return false;
        },
        **event);
    if (wanted) return event;
    if (now() > until) return std::nullopt;
  }
}

Status RigConnection::rest(Duration how_long) {
  const Duration until = now() + how_long;
  for (Duration left = how_long; left > Duration(); left = until - now()) {
    NODAL_TRY(next_event(left));
  }
  return {};
}

Status RigConnection::send_item(BulkItem item) {
  if (dead_) return fail(*dead_);
  NODAL_TRY_ASSIGN(const StreamId stream, session_.open_stream(StreamPolicy::kLossless));
  NODAL_TRY(session_.offer(stream, std::move(item)));
  std::optional<Error> refused;
  ProgressFloor floor(patience_, now());
  const auto taken = [&] {
    while (const std::optional<StreamStopped> stopped = session_.take_stopped()) {
      if (stopped->stream == stream) refused = stopped->why;
    }
    const std::optional<StreamCounts> counts = session_.counts(stream);
    if (counts) floor.moved_to(counts->bytes, now());
    return refused || !counts || counts->delivered == counts->offered;
  };
  NODAL_TRY(step_until(taken, "the rig to take more of what is sent", patience_, &floor));
  if (refused) return fail(*refused);
  session_.close_stream(stream);
  return {};
}

void RigConnection::stop_stream(StreamId stream) {
  if (!dead_) session_.stop_stream(stream, Error{Errc::kCancelled, "the client has what it wants"});
}

Status RigConnection::step_until(const std::function<bool()>& done, const std::string& what, Duration within,
                                 ProgressFloor* floor) {
  const Duration begun = now();
  while (!done()) {
    if (interrupted()) return cancelled();
    const Duration left = floor != nullptr ? std::max(Duration(), floor->left(now())) : within - (now() - begun);
    if (floor != nullptr ? floor->stalled(now()) : left <= Duration()) {
      return fail(Errc::kTimeout, fmt::format("{}: waited {} for {}; the rig may be busy (--timeout waits longer) or "
                                              "the link stuck",
                                              address_, show_duration(static_cast<std::uint64_t>(within.ns())), what));
    }
    const Status stepped = step(left);
    sort_answers();
    if (!stepped) return stepped;
    if (!session_.wants_input() && session_.error() == nullptr) {
      return fail(Errc::kOverload, fmt::format("{}: the rig sends streams without end, and not {}", address_, what));
    }
  }
  return {};
}

Status RigConnection::step(Duration at_most) {
  if (dead_) return fail(*dead_);
  bool moved = false;

  // Writes as much as the link accepts.
  for (std::span<const std::uint8_t> out = session_.output(); !out.empty(); out = session_.output()) {
    const Result<std::size_t> taken = link_->write(out);
    if (!taken) break;  // the read below returns the reason, after the rig's last messages
    if (*taken == 0) break;
    session_.sent(*taken);
    moved = true;
  }

  if (session_.wants_input()) {
    std::array<std::uint8_t, 65536> buffer;
    const Result<std::size_t> got = link_->read(buffer);
    if (!got) {
      dead_ = link_lost(got.error()).value();
      return fail(*dead_);
    }
    if (*got != 0) {
      received_at_ = now();
      quiet_.moved(*got, received_at_);
      probed_.moved(*got, received_at_);
      moved = true;
    }
    if (const Status received = session_.receive(std::span(buffer).first(*got)); !received) {
      (void)link_->write(session_.output());  // one try to send the Bye, which tells the rig the reason
      dead_ = received.error().in(address_);
      return fail(*dead_);
    }
  }
  if (!moved) wait_(*link_, !session_.output().empty(), at_most);
  return {};
}

tl::unexpected<Error> RigConnection::link_lost(const Error& error) const {
  if (session_.peer_hello() == nullptr) {
    return fail(error.code, fmt::format("the connection ended before the rig answered ({})", error.message));
  }
  return fail(error.code, fmt::format("{}: the link was lost ({}); the rig goes on with what it was doing, and "
                                      "`nodal status` tells whether it can be reached again",
                                      address_, error.message));
}

}  // namespace nodal::host
