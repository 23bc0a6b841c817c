#include "firmware/hosts/admission.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <string>

namespace nodal::firmware {
namespace {

using ClientList = std::vector<Client*>;

template <class Condition>
ClientList select(const Clients& clients, Condition condition) {
  ClientList some;
  for (const auto& client : clients) {
    if (!client->ending() && condition(*client)) some.push_back(client.get());
  }
  return some;
}

template <class Condition>
ClientList select(const ClientList& of, Condition condition) {
  ClientList some;
  std::copy_if(of.begin(), of.end(), std::back_inserter(some),
               [&](const Client* client) { return condition(*client); });
  return some;
}

/// The clients of the largest group with equal keys.
template <class Key>
ClientList of_most(const ClientList& some, Key key) {
  const auto sharing = [&](const Client* one) {
    return std::count_if(some.begin(), some.end(), [&](const Client* other) { return key(*other) == key(*one); });
  };
  std::ptrdiff_t most = 0;
  for (const Client* one : some) most = std::max(most, sharing(one));
  return select(some, [&](const Client& client) { return sharing(&client) == most; });
}

/// The clients of the user with the most, and of these the ones of that user's process with the most.
ClientList of_heaviest_user(const ClientList& some) {
  const auto user = [](const Client& client) {
    const auto identity = client.identity();
    return identity ? std::optional(identity->user) : std::nullopt;
  };
  return of_most(of_most(some, user), [](const Client& client) { return client.identity(); });
}

/// Null when there is none.
Client* idle_longest(const ClientList& some) {
  const auto found = std::min_element(some.begin(), some.end(), [](const Client* a, const Client* b) {
    return a->activity().idle_since() < b->activity().idle_since();
  });
  return found == some.end() ? nullptr : *found;
}

/// A host that was idle for longer is closed first.
constexpr Duration kLongIdle = Duration::seconds(10);

/// Which of these hosts to close.
Client* host_to_close(const ClientList& hosts, Instant now) {
  const ClientList some = of_heaviest_user(hosts);
  const auto first = [&](auto condition) { return idle_longest(select(some, condition)); };
  if (Client* one =
          first([&](const Client& c) { return !c.active(now) && now - c.activity().idle_since() > kLongIdle; }))
    return one;
  // Among hosts that send requests all the time, the newest host would be the one idle longest, so new hosts are
  // spared. In a flood of new hosts, these are closed and no older one.
  const auto fresh = [&](const Client& c) { return !c.has_work() && now - c.activity().since() < Admission::kSpared; };
  if (const ClientList young = select(some, fresh); young.size() > Admission::kMaxSpared) {
    const ClientList silent = select(young, [](const Client& c) { return !c.activity().has_requested(); });
    return idle_longest(silent.size() > Admission::kMaxSpared ? silent : young);
  }
  if (Client* one = first([&](const Client& c) { return !fresh(c) && !c.active(now); })) return one;
  if (Client* one = first([&](const Client& c) { return !fresh(c) && !c.has_work(); })) return one;
  if (Client* one = first([](const Client& c) { return !c.has_work(); })) return one;
  return idle_longest(some);
}

Error too_many(std::size_t limit, const char* of_what) {
  return Error{Errc::kOverload,
               fmt::format("this rig accepts {} {} at once; another one connected, and this one was idle longest",
                           limit, of_what)};
}

Error displaced(const std::string& why) {
  return Error{Errc::kOverload, "closed for another host that wants to pull or upload: " + why};
}

}  // namespace

std::size_t Admission::links_at(const Listener& listener, const Clients& clients) {
  return static_cast<std::size_t>(std::count_if(
      clients.begin(), clients.end(), [&](const auto& client) { return client->access() == listener.access; }));
}

void Admission::add_wake_ups(const Clients& clients, hal::WakeUps& to) const {
  for (const Listener& listener : listeners_) {
    if (links_at(listener, clients) < places(kMaxLinks, listener.access)) listener.port->add_wake_ups(to);
  }
}

bool Admission::accept(Clients& clients, const std::function<wire::Hello(Access)>& hello, Instant now) {
  bool any = false;
  for (const Listener& listener : listeners_) {
    std::size_t links = links_at(listener, clients);
    for (std::size_t i = 0; i < kAcceptsAStep && links < places(kMaxLinks, listener.access); ++i, ++links) {
      auto link = listener.port->accept();
      if (!link || !*link) break;
      any = true;
      clients.push_back(
          std::make_unique<Client>(next_number_++, std::move(*link), listener.access, hello(listener.access), now));
    }
  }
  return any;
}

void Admission::close_excess(Clients& clients, Instant now) {
  for (const Access at : kAccessLevels) {
    const auto strangers = [&] {
      return select(clients, [&](const Client& c) { return c.access() == at && !c.said_hello(); });
    };
    const auto hosts = [&] {
      return select(clients, [&](const Client& c) { return c.access() == at && c.said_hello(); });
    };
    const std::size_t most_strangers = places(kMaxStrangers, at);
    for (ClientList all = strangers(); all.size() > most_strangers; all = strangers()) {
      idle_longest(of_heaviest_user(all))->end(too_many(most_strangers, "programs that have not sent a hello"), now);
    }
    const std::size_t most_hosts = places(kMaxClients, at);
    for (ClientList all = hosts(); all.size() > most_hosts; all = hosts()) {
      host_to_close(all, now)->end(too_many(most_hosts, "hosts"), now);
    }
  }
}

Status Admission::may_work(const Clients& clients, const Client& client, Instant now) {
  const ClientList working =
      select(clients, [&](const Client& c) { return c.access() == client.access() && c.has_work(); });
  const std::size_t most = places(kMaxWorking, client.access());
  if (client.has_work() || working.size() < most) return {};
  if (Client* one = idle_longest(select(working, [&](const Client& c) { return !c.active(now); }))) {
    one->end(displaced(fmt::format("this host's link has made no progress for {} s",
                                   HostActivity::kStalledAfter.ms() / 1000)),
             now);
    return {};
  }
  const ClientList many = of_heaviest_user(select(
      clients, [&](const Client& c) { return c.access() == client.access() && (c.has_work() || &c == &client); }));
  if (std::find(many.begin(), many.end(), &client) == many.end()) {
    idle_longest(many)->end(displaced("this host's user has the most hosts that pull or upload"), now);
    return {};
  }
  return fail(Errc::kOverload,
              fmt::format("{} hosts pull or upload already; `nodal hosts` lists them and can close one", most));
}

}  // namespace nodal::firmware
