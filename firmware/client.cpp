#include "firmware/client.h"

#include <array>

namespace nodal::firmware {
namespace {

constexpr std::size_t kReadBytes = 64U << 10;
constexpr int kReadsAStep = 4;    ///< so that one client's flood leaves time for the others
constexpr int kWritesAStep = 16;
constexpr Duration kFarewellWithin = Duration::seconds(1);

}  // namespace

Client::Client(std::uint64_t number, std::unique_ptr<hal::LinkPort> link, Access access, const wire::Hello& mine,
               Instant now)
    : number_(number),
      link_(std::move(link)),
      access_(access),
      name_("host " + std::to_string(number) + " at " + link_->peer()),
      session_(Role::kRig, mine),
      since_(now) {}

std::string Client::who() const {
  const auto identity = link_->identity();
  if (!identity) return name_;
  return "user " + std::to_string(identity->user) + ", process " + std::to_string(identity->process) + ", " + name_;
}

void Client::go(const Error& why) {
  if (gone_) return;
  gone_ = true;
  why_ = why;
}

void Client::end(const Error& why, Instant now) {
  session_.close(why);
  if (!dying_since_) dying_since_ = now;
}

bool Client::pump_in(Instant now) {
  if (gone_ || session_.error()) return false;
  if (!session_.peer_hello() && now - since_ > kHelloWithin) {
    end(Error{Errc::kTimeout, "no hello came; a host says it first"}, now);
    return true;
  }
  std::array<std::uint8_t, kReadBytes> bytes;
  bool any = false;
  for (int i = 0; i < kReadsAStep && session_.wants_input(); ++i) {
    const auto read = link_->read(bytes);
    if (!read) {
      go(read.error());
      return true;
    }
    if (*read == 0) break;
    any = true;
    if (!session_.receive(std::span(bytes).first(*read))) {
      dying_since_ = now;
      break;
    }
  }
  return any;
}

bool Client::pump_out(Instant now) {
  if (gone_) return false;
  bool any = false;
  for (int i = 0; i < kWritesAStep; ++i) {
    const auto output = session_.output();
    if (output.empty()) {
      if (session_.error()) go(*session_.error());
      return any;
    }
    const auto wrote = link_->write(output);
    if (!wrote) {
      go(wrote.error());
      return true;
    }
    if (*wrote == 0) break;
    session_.sent(*wrote);
    any = true;
  }
  if (session_.error() && dying_since_ && now - *dying_since_ > kFarewellWithin) go(*session_.error());
  return any;
}

}  // namespace nodal::firmware
