#include "firmware/hosts/host_activity.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

namespace nodal::firmware {
namespace {

std::string seconds(Duration duration) { return fmt::format("{} s", duration.ms() / 1000); }

}  // namespace

void HostActivity::on_received(const Session& session, Instant now) {
  if (begins_frame_ || session.frames_received() != frames_) frame_since_ = now;
  frames_ = session.frames_received();
  on_moved(session, now);
}

void HostActivity::on_moved(const Session& session, Instant now) {
  const std::uint64_t bytes = session.bulk_taken() + session.bulk_received();
  if (std::exchange(bulk_, bytes) != bytes) moved_ = used_ = now;
}

std::optional<Error> HostActivity::overdue(const Session& session, Instant now) const {
  if (session.peer_hello() == nullptr && now - since_ > kHelloWithin) {
    return Error{Errc::kTimeout,
                 "no hello arrived within " + seconds(kHelloWithin) + " of the connection; a host must send it first"};
  }
  const std::size_t under_way = session.bytes_under_way();
  const auto more = Duration::seconds(static_cast<std::int64_t>(under_way / kSlowestBytes));
  // While the session does not accept input, the rest of the frame may have arrived and not been read.
  if (under_way > 0 && session.wants_input() && now - frame_since_ > kFrameWithin + more) {
    return Error{Errc::kTimeout, "a frame that began " + seconds(now - frame_since_) + " ago is still incomplete"};
  }
  if (session.version() >= kProtocolPing && now - std::max(received_at_, moved_) > kSilentFor) {
    return Error{Errc::kTimeout, "the host sent nothing for " + seconds(kSilentFor) + ", not even answers to pings"};
  }
  return std::nullopt;
}

bool HostActivity::ping_due(bool leases, Instant now) {
  const Duration every = leases ? kLeasePingEvery : kPingEvery;
  if (now - received_at_ <= every || now - pinged_ <= every) return false;
  pinged_ = now;
  return true;
}

}  // namespace nodal::firmware
