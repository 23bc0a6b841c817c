#include "firmware/admission.h"

#include <algorithm>
#include <string>

namespace nodal::firmware {
namespace {

/// The client that `counts` and was idle longest; null when none counts.
template <class Counts>
Client* idle_longest(const Clients& clients, Counts counts) {
  Client* longest = nullptr;
  for (const auto& client : clients) {
    if (client->ending() || !counts(*client)) continue;
    if (!longest || client->idle_since() < longest->idle_since()) longest = client.get();
  }
  return longest;
}

template <class Counts>
std::size_t count(const Clients& clients, Counts counts) {
  return static_cast<std::size_t>(std::count_if(
      clients.begin(), clients.end(), [&](const auto& client) { return !client->ending() && counts(*client); }));
}

Error too_many(std::size_t limit, const char* of_what) {
  return Error{Errc::kOverload, "this rig talks to " + std::to_string(limit) + " " + of_what +
                                    " at once; another one came, and this one was idle longest"};
}

constexpr Duration kSpared = Duration::seconds(2);  ///< in which a new host asks its first question

bool is_stranger(const Client& client) { return !client.said_hello(); }
bool is_host(const Client& client) { return client.said_hello(); }

}  // namespace

bool Admission::accept(Clients& clients, const std::function<wire::Hello(Access)>& hello, Instant now) {
  bool any = false;
  for (const Listener& listener : listeners_) {
    for (std::size_t i = 0; i < kAcceptsAStep && clients.size() < kMaxLinks; ++i) {
      auto link = listener.port->accept();
      if (!link || !*link) break;
      any = true;
      clients.push_back(std::make_unique<Client>(next_number_++, std::move(*link), listener.access,
                                                 hello(listener.access), now));
    }
  }
  return any;
}

void Admission::make_room(Clients& clients, Instant now) {
  while (count(clients, is_stranger) > kMaxStrangers) {
    idle_longest(clients, is_stranger)->end(too_many(kMaxStrangers, "programs that have not said hello"), now);
  }
  while (count(clients, is_host) > kMaxClients) {
    // Beside hosts that ask all the time, the one idle longest is the one that has just come: it is spared for a while.
    const auto spared = [&](const Client& c) { return now - c.since() < kSpared; };
    Client* one = idle_longest(clients, [&](const Client& c) { return is_host(c) && !c.active(now) && !spared(c); });
    if (!one) one = idle_longest(clients, [&](const Client& c) { return is_host(c) && !c.works() && !spared(c); });
    if (!one) one = idle_longest(clients, [](const Client& c) { return is_host(c) && !c.works(); });
    if (!one) one = idle_longest(clients, is_host);
    one->end(too_many(kMaxClients, "hosts"), now);
  }
}

Status Admission::may_work(const Clients& clients, const Client& client, Instant now) {
  if (client.works() || count(clients, [](const Client& c) { return c.works(); }) < kMaxWorking) return {};
  if (Client* one = idle_longest(clients, [&](const Client& c) { return c.works() && !c.active(now); })) {
    one->end(Error{Errc::kOverload, "another host wants to pull or upload, and this one has taken nothing for " +
                                        std::to_string(Client::kStalledAfter.ms() / 1000) + " s"}, now);
    return {};
  }
  return fail(Errc::kOverload, std::to_string(kMaxWorking) +
                                   " hosts pull or upload already; `nodal hosts` lists them and can end one");
}

}  // namespace nodal::firmware
