#include "firmware/hosts/client.h"

#include <fmt/format.h>

#include <array>
#include <utility>

namespace nodal::firmware {
namespace {

constexpr std::size_t kReadBytes = 64U << 10;
constexpr int kReadsAStep = 4;  ///< leaves time for other clients when one sends without a pause
constexpr int kWritesAStep = 16;
constexpr Duration kFarewellWithin = Duration::seconds(1);

}  // namespace

Client::Client(std::uint64_t number, std::unique_ptr<hal::LinkPort> link, Access access, const wire::Hello& mine,
               Instant now)
    : number_(number),
      link_(std::move(link)),
      access_(access),
      name_(fmt::format("host {} at {}", number, link_->peer())),
      session_(Role::kRig, mine),
      activity_(now) {}

std::string Client::who() const {
  const auto identity = this->identity();
  if (!identity) return name_;
  // A socket's name of its peer ends with both already.
  return fmt::format("user {}, process {}, {}", identity->user, identity->process,
                     name_.substr(0, name_.rfind(" (process ")));
}

std::string Client::party() const {
  const auto identity = this->identity();
  return (identity ? fmt::format("user {}", identity->user) : std::string("somebody")) +
         fmt::format(" at the {} socket", socket_name(access_));
}

void Client::finish(const Error& why) {
  if (gone_) return;
  gone_ = true;
  why_ = why;
}

void Client::end(const Error& why, Instant now) {
  session_.close(why);
  if (!ending_since_) ending_since_ = now;
}

bool Client::active(Instant now) const {
  if (requests_open > 0 || held) return true;
  const auto waits_for_link = [&](StreamId stream) {
    const auto counts = session_.counts(stream);
    return counts && counts->pending > 0;
  };
  bool pending = (frame_set && waits_for_link(*frame_set)) || (take_file && waits_for_link(*take_file));
  for (const auto& [stream, pull] : pulls) pending |= pull.ended || waits_for_link(stream);
  const bool takes = !pulls.empty() || frame_set || take_file;
  return (takes && !pending) || (has_work() && !activity_.stalled(now));
}

bool Client::pump_in(Instant now) {
  if (ending()) return false;
  std::array<std::uint8_t, kReadBytes> bytes;
  bool any = false;
  for (int i = 0; i < kReadsAStep && session_.wants_input(); ++i) {
    const auto read = link_->read(bytes);
    if (!read) {
      finish(read.error());
      return true;
    }
    if (*read == 0) break;
    any = true;
    activity_.on_read(*read, session_, now);
    if (!session_.receive(std::span(bytes).first(*read))) {
      ending_since_ = now;
      return true;
    }
    activity_.on_received(session_, now);
  }
  if (const auto late = activity_.overdue(session_, now)) {
    end(*late, now);
    return true;
  }
  if (activity_.ping_due(leases, now)) session_.ping();
  return any;
}

bool Client::pump_out(Instant now) {
  if (gone_) return false;
  bool any = false;
  for (int i = 0; i < kWritesAStep; ++i) {
    const auto output = session_.output();
    if (output.empty()) {
      if (session_.error()) finish(*session_.error());
      return any;
    }
    const auto wrote = link_->write(output);
    if (!wrote) {
      finish(wrote.error());
      return true;
    }
    if (*wrote == 0) break;
    session_.sent(*wrote);
    activity_.on_written(*wrote);
    activity_.on_moved(session_, now);
    any = true;
  }
  if (session_.error() && ending_since_ && now - *ending_since_ > kFarewellWithin) finish(*session_.error());
  return any;
}

void Client::add_wake_ups(hal::WakeUps& to) {
  if (gone_) return;
  link_->add_wake_ups(to, !ending() && session_.wants_input(), !session_.output().empty());
}

}  // namespace nodal::firmware
