// Replies to hosts, at once and when another stage has answered.
#pragma once

#include <cstdint>
#include <map>

#include "firmware/config/config.h"
#include "firmware/hosts/client.h"
#include "firmware/operate/commands.h"
#include "protocol/base/result.h"
#include "protocol/session.h"

namespace nodal::firmware {

/// The client with this number; null when it has left.
Client* find_client(const Clients& clients, std::uint64_t number);

/// Knows which host's request waits for which ticket. A client counts its requests that wait in
/// Client::requests_open.
///
/// Threading: thread-bound to control.
/// Ownership: configuration and clients outlive it.
/// Errors: none; a client that does not read its replies loses its connection.
class Replies {
 public:
  Replies(const RigConfig& config, const Clients& clients) : config_(config), clients_(clients) {}

  void send(Client& client, const wire::Reply& message, Instant now) const;
  void refuse(Client& client, std::uint64_t request, const Error& error, Instant now) const;
  /// settle() will send the answer.
  void await(Client& client, std::uint64_t request, Ticket ticket);
  /// Sends the answer to the host that waits for it; none does for those of the button and of the stored settings.
  void settle(const Answer& answer, Instant now);
  /// Number of requests that wait, those of hosts that have left included.
  std::size_t waiting() const { return waiting_.size(); }

 private:
  struct Waiting {
    std::uint64_t client = 0;
    std::uint64_t request = 0;  ///< id of the request
  };

  const RigConfig& config_;
  const Clients& clients_;
  std::map<Ticket, Waiting> waiting_;
};

}  // namespace nodal::firmware
