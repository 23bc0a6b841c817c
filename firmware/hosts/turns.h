// Requests that wait until it is their host's turn.
#pragma once

#include <cstdint>
#include <map>
#include <optional>

#include "firmware/hosts/access.h"
#include "firmware/hosts/client.h"
#include "firmware/hosts/fair_queue.h"
#include "firmware/operate/commands.h"
#include "protocol/session.h"

namespace nodal::firmware {

/// Requests for one thing that only one host can have at a time, at most one of each host. A client counts the request
/// that waits in Client::requests_open.
///
/// Threading: thread-bound to control.
/// Ownership: owns the requests.
/// Errors: none.
class Turns {
 public:
  void add(Client& client, const wire::Request& request);
  bool waits(std::uint64_t host) const { return order_.waits(host); }
  /// Access of the first host, if one waits.
  std::optional<Access> highest() const { return order_.highest(); }
  /// The host has left.
  void leave(std::uint64_t host);

  struct Next {
    Client* client = nullptr;  ///< null: the host has left
    wire::Request request;
  };
  /// The request whose turn it is; nothing if none waits.
  std::optional<Next> next(const Clients& clients);

  /// Another stage carries out a request of these; until its answer, no other should be begun.
  void begin(Ticket ticket) { working_ = ticket; }
  bool working() const { return working_.has_value(); }
  void end(Ticket ticket) {
    if (working_ == ticket) working_.reset();
  }

 private:
  FairQueue order_;
  std::map<std::uint64_t, wire::Request> requests_;  ///< by host
  std::optional<Ticket> working_;
};

}  // namespace nodal::firmware
