// Who may talk to the rig when many want to.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "firmware/access.h"
#include "firmware/client.h"
#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::firmware {

/// Lets hosts in, and closes others when there are too many, so that a new host can always connect:
///
/// - Links without a hello are counted apart; the oldest makes room.
/// - Of the hosts that said hello the one idle longest makes room. One that pulls or uploads and whose bytes move, or
///   that waits for an answer, is not closed for a newcomer.
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
  /// Whether this client may begin to pull or upload; a stalled one makes room. Errors: kOverload.
  static Status may_work(const Clients& clients, const Client& client, Instant now);

  static constexpr std::size_t kMaxClients = 12;    ///< that said hello
  static constexpr std::size_t kMaxWorking = 8;     ///< of them, that pull or upload: as many as the board can feed
  static constexpr std::size_t kMaxStrangers = 8;   ///< links without a hello
  static constexpr std::size_t kMaxLinks = 32;      ///< in all, those included that are being told why they are closed
  static constexpr std::size_t kAcceptsAStep = 4;   ///< of a listener: a flood of links leaves time for hosts

 private:
  std::vector<Listener> listeners_;
  std::uint64_t next_number_ = 1;
};

}  // namespace nodal::firmware
