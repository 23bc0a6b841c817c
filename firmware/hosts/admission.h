// Limits the number of connections, and chooses which one to close for a new one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "firmware/hosts/access.h"
#include "firmware/hosts/client.h"
#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::firmware {

/// Accepts hosts, and closes others when there are too many, so that a new host can always connect. The limits apply:
///
/// - Per socket: hosts at the view-only and at the operate socket have limits of their own, half of those of the
///   control socket.
/// - Per user: the connection to close is chosen from the user with the most connections, and from that user's process
///   with the most. So a flood of connections of one user closes only connections of that user.
/// - Links without a hello have a limit of their own; the oldest of them is closed.
/// - Of the hosts that sent a hello, the one idle longest is closed. A host is not closed for a new one while it waits
///   for an answer, or pulls or uploads and its bytes move. Up to kMaxSpared new hosts are spared for kSpared; in a
///   flood of new hosts, the others of them are closed.
/// - Fewer hosts may pull or upload at once than may be connected, so that there is always one that can be closed.
///
/// Threading: thread-bound to control.
/// Ownership: listeners outlive it; the clients are Control's.
/// Errors: may_work()'s.
class Admission {
 public:
  explicit Admission(std::vector<Listener> listeners) : listeners_(std::move(listeners)) {}

  /// Accepts waiting links. `hello` makes the rig's hello. True when there was a link.
  bool accept(Clients& clients, const std::function<wire::Hello(Access)>& hello, Instant now);
  /// Adds what wakes control when a host connects, unless there are too many links to accept one.
  void add_wake_ups(const Clients& clients, hal::WakeUps& to) const;
  /// Closes the connections over the limits. Call it after bytes were read, so that a received hello counts.
  void close_excess(Clients& clients, Instant now);
  /// Whether this client may begin to pull or upload. Beyond the limit, first closes a stalled host, or else one of a
  /// user with more hosts that pull or upload. Errors: kOverload.
  static Status may_work(const Clients& clients, const Client& client, Instant now);

  static constexpr std::size_t kMaxClients = 12;   ///< hosts that sent a hello
  static constexpr std::size_t kMaxWorking = 8;    ///< hosts that pull or upload: as many as the board can serve
  static constexpr std::size_t kMaxStrangers = 8;  ///< links without a hello
  static constexpr std::size_t kMaxLinks = 32;     ///< all links, also those whose farewell is still being sent
  static constexpr std::size_t kMaxSpared = 4;     ///< new hosts that are not closed for kSpared
  static constexpr Duration kSpared = Duration::seconds(2);
  static constexpr std::size_t kAcceptsAStep = 4;  ///< per listener: leaves time for hosts during a flood of links
  /// The limit at one socket, from that at the control socket.
  static constexpr std::size_t places(std::size_t at_control, Access at) {
    return at == Access::kControl ? at_control : at_control / 2;
  }
  /// The sum of the limits at all sockets.
  static constexpr std::size_t in_all(std::size_t at_control) {
    std::size_t sum = 0;
    for (const Access at : kAccessLevels) sum += places(at_control, at);
    return sum;
  }

 private:
  /// The number of links at a listener's level of access.
  static std::size_t links_at(const Listener& listener, const Clients& clients);

  std::vector<Listener> listeners_;
  std::uint64_t next_number_ = 1;
};

}  // namespace nodal::firmware
