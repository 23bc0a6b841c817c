// Who may talk to the rig when many want to.
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

/// Lets hosts in, and closes others when there are too many, so that a new host can always connect. Places are kept:
///
/// - By socket: hosts at the view-only socket have places of their own, half as many of each kind.
/// - By user: of those that could make room, the one to go is of the user who has most of them, and of this user's
///   process that has most. So a storm of one user's closes that user's own.
/// - Links without a hello are counted apart; the oldest makes room.
/// - Of the hosts that said hello the one idle longest makes room. One that pulls or uploads and whose bytes move, or
///   that waits for an answer, is not closed for a newcomer. Some hosts that have just come are spared; a storm of such
///   hosts closes its own.
/// - Fewer hosts may pull or upload at once than may be connected, so that there always is one that can be closed.
///
/// Threading: thread-bound to control.
/// Ownership: listeners outlive it; the clients are Control's.
/// Errors: may_work()'s.
class Admission {
 public:
  explicit Admission(std::vector<Listener> listeners) : listeners_(std::move(listeners)) {}

  /// Takes links that wait. `hello` makes what the rig says first. True when there was any.
  bool accept(Clients& clients, const std::function<wire::Hello(Access)>& hello, Instant now);
  /// Closes those that are too many. Call after bytes were read, so that a hello that has come counts.
  void make_room(Clients& clients, Instant now);
  /// Whether this client may begin to pull or upload. A stalled one makes room, or one of a user who has more that do.
  /// Errors: kOverload.
  static Status may_work(const Clients& clients, const Client& client, Instant now);

  static constexpr std::size_t kMaxClients = 12;   ///< that said hello
  static constexpr std::size_t kMaxWorking = 8;    ///< of them, that pull or upload: as many as the board can feed
  static constexpr std::size_t kMaxStrangers = 8;  ///< links without a hello
  static constexpr std::size_t kMaxLinks = 32;     ///< in all, those included that are being told why they are closed
  static constexpr std::size_t kMaxSpared = 4;     ///< hosts that have just come, for kSpared
  static constexpr Duration kSpared = Duration::seconds(2);
  static constexpr std::size_t kAcceptsAStep = 4;  ///< of a listener: a flood of links leaves time for hosts
  /// The places at one socket, where the control socket has so many.
  static constexpr std::size_t places(std::size_t at_control, Access at) {
    return at == Access::kControl ? at_control : at_control / 2;
  }
  /// At both sockets.
  static constexpr std::size_t in_all(std::size_t at_control) {
    return places(at_control, Access::kControl) + places(at_control, Access::kView);
  }

 private:
  std::vector<Listener> listeners_;
  std::uint64_t next_number_ = 1;
};

}  // namespace nodal::firmware
