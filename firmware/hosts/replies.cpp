#include "firmware/hosts/replies.h"

#include <algorithm>

#include "firmware/hosts/wire_commands.h"

namespace nodal::firmware {

Client* find_client(const Clients& clients, std::uint64_t number) {
  const auto found =
      std::find_if(clients.begin(), clients.end(), [&](const auto& client) { return client->number() == number; });
  return found == clients.end() ? nullptr : found->get();
}

void Replies::send(Client& client, const wire::Reply& message, Instant now) const {
  if (client.session().error()) return;
  if (const Status sent = client.session().send(message); !sent && !client.session().error()) {
    client.end(sent.error(), now);  // the client sends requests and does not read the replies
  }
}

void Replies::refuse(Client& client, std::uint64_t request, const Error& error, Instant now) const {
  wire::Reply message = reply_of({0, fail(error)}, config_);
  message.set_id(request);
  send(client, message, now);
}

void Replies::await(Client& client, std::uint64_t request, Ticket ticket) {
  waiting_[ticket] = Waiting{client.number(), request};
  ++client.requests_open;
}

void Replies::settle(const Answer& answer, Instant now) {
  const auto found = waiting_.find(answer.ticket);
  if (found == waiting_.end()) return;
  const Waiting waiting = found->second;
  waiting_.erase(found);
  Client* const client = find_client(clients_, waiting.client);
  if (!client) return;
  --client->requests_open;
  wire::Reply message = reply_of(answer, config_);
  message.set_id(waiting.request);
  send(*client, message, now);
}

}  // namespace nodal::firmware
