#include "firmware/hosts/turns.h"

#include <utility>

#include "firmware/hosts/replies.h"

namespace nodal::firmware {

void Turns::add(Client& client, const wire::Request& request) {
  order_.add({client.number(), client.access(), client.identity()});
  requests_[client.number()] = request;
  ++client.requests_open;
}

void Turns::leave(std::uint64_t host) {
  order_.leave(host);
  requests_.erase(host);
}

std::optional<Turns::Next> Turns::next(const Clients& clients) {
  const auto host = order_.next();
  if (!host) return std::nullopt;
  Next next{find_client(clients, *host), std::move(requests_.extract(*host).mapped())};
  if (next.client) --next.client->requests_open;
  return next;
}

}  // namespace nodal::firmware
