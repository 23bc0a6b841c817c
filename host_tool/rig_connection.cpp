#include "host_tool/rig_connection.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "hal/linux/link/socket_link.h"
#include "host_tool/interrupt.h"
#include "host_tool/quantities.h"

namespace nodal::host {
namespace {

constexpr Duration kLookEvery = Duration::seconds(1);
constexpr std::string_view kSoftware = "nodal " NODAL_VERSION;

Duration now() {
  using namespace std::chrono;
  return Duration::nanoseconds(duration_cast<nanoseconds>(steady_clock::now().time_since_epoch()).count());
}

tl::unexpected<Error> cancelled() { return fail(Errc::kCancelled, "stopped by Ctrl-C"); }

/// The link's own words, and how else to get there.
tl::unexpected<Error> no_rig(const RigAddress& address, const Error& error) {
  if (address.command.empty()) {
    return fail(error.code, fmt::format("{} (--rig or NODAL_RIG say where else to look)", error.message));
  }
  return fail(Errc::kUnreachable, fmt::format("no rig at {}: {}; does `{}` work when you run it yourself?", address.text,
                                              error.message, fmt::join(address.command, " ")));
}

}  // namespace

void wait_by_poll(hal::LinkPort& link, bool to_write, Duration at_most) {
  const hal::LinkDescriptors descriptors = hal::link_descriptors(link);
  std::array<pollfd, 2> fds{};
  fds[0] = {descriptors.read_from, POLLIN, 0};
  fds[1] = {to_write ? descriptors.write_to : -1, POLLOUT, 0};
  const std::int64_t ms = std::clamp<std::int64_t>((at_most.ns() + 999'999) / 1'000'000, 0, 250);
  poll(fds.data(), fds.size(), static_cast<int>(ms));  // EINTR: the caller looks at interrupted()
}

Result<std::unique_ptr<RigConnection>> RigConnection::open(const RigAddress& address, Duration patience) {
  Result<std::unique_ptr<hal::LinkPort>> link =
      address.command.empty() ? hal::connect_link(address.link) : hal::spawn_link(address.command);
  if (!link) return no_rig(address, link.error());
  auto connection = over(std::move(*link), address.text, patience, wait_by_poll);
  if (!connection && connection.error().code == Errc::kLinkClosed) {
    const std::string why = address.command.empty() ? address.text + ": " + connection.error().message
                                                    : connection.error().message;
    return no_rig(address, Error{Errc::kUnreachable, why});
  }
  return connection;
}

Result<std::unique_ptr<RigConnection>> RigConnection::over(std::unique_ptr<hal::LinkPort> link,
                                                           std::string address, Duration patience,
                                                           WaitForLink wait) {
  std::unique_ptr<RigConnection> connection(
      new RigConnection(std::move(link), std::move(address), patience, std::move(wait)));
  if (const Status hello = connection->say_hello(); !hello) return fail(hello.error());
  return connection;
}

RigConnection::RigConnection(std::unique_ptr<hal::LinkPort> link, std::string address, Duration patience,
                             WaitForLink wait)
    : link_(std::move(link)), address_(std::move(address)), patience_(patience), wait_(std::move(wait)),
      session_(Role::kHost, make_hello(std::string(kSoftware))) {}

Status RigConnection::say_hello() {
  return step_until([this] { return session_.peer_hello() != nullptr; }, "the rig's hello");
}

Result<std::uint64_t> RigConnection::post(wire::Request& request) {
  if (dead_) return fail(*dead_);
  request.set_id(next_request_++);
  if (const Status sent = session_.send(request); !sent) return fail(sent.error());
  return request.id();
}

bool RigConnection::answered(std::uint64_t id) const {
  return std::ranges::any_of(replies_, [id](const wire::Reply& reply) { return reply.id() == id; });
}

Result<wire::Reply> RigConnection::take_answer(std::uint64_t id) {
  const auto found = std::ranges::find(replies_, id, [](const wire::Reply& reply) { return reply.id(); });
  NODAL_ASSERT(found != replies_.end());
  wire::Reply reply = std::move(*found);
  replies_.erase(found);
  if (reply.has_error()) return fail(static_cast<Errc>(reply.error().code()), reply.error().message());
  return reply;
}

Result<wire::Reply> RigConnection::ask(wire::Request request) {
  const Result<std::uint64_t> id = post(request);
  if (!id) return fail(id.error());
  if (const Status waited = step_until([&] { return answered(*id); }, "an answer"); !waited) {
    return fail(waited.error());
  }
  return take_answer(*id);
}

Result<wire::Reply> RigConnection::ask_long(wire::Request request,
                                            const std::function<void(const wire::RigStatus&)>& meanwhile) {
  const Result<std::uint64_t> id = post(request);
  if (!id) return fail(id.error());
  while (true) {
    const Status waited = step_until([&] { return answered(*id); }, "an answer", std::min(kLookEvery, patience_));
    if (waited) return take_answer(*id);
    if (waited.error().code != Errc::kTimeout) return fail(waited.error());
    wire::Request status;
    status.mutable_status();
    const Result<wire::Reply> how = ask(status);
    if (!how) return fail(how.error());
    meanwhile(how->status());
  }
}

Result<std::optional<Event>> RigConnection::next_event(Duration at_most) {
  const Duration until = now() + at_most;
  while (true) {
    // One event at a time: the session gives the rig credit for what is taken, and no more.
    while (std::optional<Event> event = take_event()) {
      if (!std::holds_alternative<wire::Reply>(*event)) return event;
      replies_.push_back(std::get<wire::Reply>(std::move(*event)));
    }
    if (interrupted()) return cancelled();
    const Duration left = until - now();
    if (left < Duration()) return std::nullopt;
    if (const Status stepped = step(left); !stepped) return fail(stepped.error());
  }
}

std::optional<Event> RigConnection::take_event() {
  if (events_.empty()) return session_.next_event();
  std::optional<Event> event = std::move(events_.front());
  events_.pop_front();
  return event;
}

Status RigConnection::send_item(BulkItem item) {
  if (dead_) return fail(*dead_);
  const Result<StreamId> stream = session_.open_stream(StreamPolicy::kLossless);
  if (!stream) return fail(stream.error());
  if (const Status offered = session_.offer(*stream, std::move(item)); !offered) return offered;
  std::optional<Error> refused;
  const auto taken = [&] {
    for (const Event& event : events_) {
      const auto* stopped = std::get_if<StreamStopped>(&event);
      if (stopped != nullptr && stopped->stream == *stream) refused = stopped->why;
    }
    const std::optional<StreamCounts> counts = session_.counts(*stream);
    return refused || !counts || counts->delivered == counts->offered;
  };
  if (const Status sent = step_until(taken, "the rig to take what is sent"); !sent) return sent;
  if (refused) return fail(*refused);
  session_.close_stream(*stream);
  return {};
}

void RigConnection::stop_stream(StreamId stream) {
  if (!dead_) session_.stop_stream(stream, Error{Errc::kCancelled, "the client has what it wants"});
}

Status RigConnection::step_until(const std::function<bool()>& done, const std::string& what, Duration within) {
  const Duration until = now() + within;
  while (!done()) {
    if (interrupted()) return cancelled();
    const Duration left = until - now();
    if (left <= Duration()) {
      return fail(Errc::kTimeout, fmt::format("{}: waited {} for {}; the rig may be busy (--timeout waits longer) or "
                                              "the link stuck", address_,
                                              show_duration(static_cast<std::uint64_t>(within.ns())), what));
    }
    if (const Status stepped = step(left); !stepped) return stepped;
    while (std::optional<Event> event = session_.next_event()) {
      if (auto* reply = std::get_if<wire::Reply>(&*event)) {
        replies_.push_back(std::move(*reply));
      } else if (!std::holds_alternative<wire::Hello>(*event)) {
        events_.push_back(std::move(*event));
      }
    }
  }
  return {};
}

Status RigConnection::step(Duration at_most) {
  if (dead_) return fail(*dead_);
  bool moved = false;

  // Out: as much as the link takes.
  for (std::span<const std::uint8_t> out = session_.output(); !out.empty(); out = session_.output()) {
    const Result<std::size_t> taken = link_->write(out);
    if (!taken) break;  // reading below says why, and gives first what the rig still had to say
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
    moved = moved || *got != 0;
    if (const Status received = session_.receive(std::span(buffer).first(*got)); !received) {
      (void)link_->write(session_.output());  // the farewell, which tells the rig why; one try
      dead_ = received.error().in(address_);
      return fail(*dead_);
    }
  }
  if (!moved) wait_(*link_, !session_.output().empty(), at_most);
  return {};
}

tl::unexpected<Error> RigConnection::link_lost(const Error& error) const {
  if (session_.peer_hello() == nullptr) {
    return fail(error.code, fmt::format("the link closed before the rig said hello ({})", error.message));
  }
  return fail(error.code, fmt::format("{}: the link was lost ({}); the rig goes on with what it was doing, and "
                                      "`nodal status` tells whether it can be reached again",
                                      address_, error.message));
}

}  // namespace nodal::host
