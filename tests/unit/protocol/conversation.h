// Two sessions and the bytes between them, for tests.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "protocol/session.h"

namespace nodal {

inline std::shared_ptr<const std::vector<std::uint8_t>> shared_bytes(std::size_t n, std::uint32_t seed = 1) {
  std::vector<std::uint8_t> bytes(n);
  std::uint32_t state = seed * 2654435761U + 1;
  for (auto& byte : bytes) {
    state = state * 1664525U + 1013904223U;
    byte = static_cast<std::uint8_t>(state >> 24);
  }
  return std::make_shared<const std::vector<std::uint8_t>>(std::move(bytes));
}

inline std::vector<Event> take_events(Session& session) {
  std::vector<Event> events;
  while (auto event = session.next_event()) events.push_back(std::move(*event));
  return events;
}

/// The session's whole output now.
inline std::vector<std::uint8_t> take_output(Session& session) {
  std::vector<std::uint8_t> bytes;
  for (auto out = session.output(); !out.empty(); out = session.output()) {
    bytes.insert(bytes.end(), out.begin(), out.end());
    session.sent(out.size());
  }
  return bytes;
}

/// The events of one kind.
template <class T>
std::vector<T> only(const std::vector<Event>& events) {
  std::vector<T> found;
  for (const Event& event : events) {
    if (const T* one = std::get_if<T>(&event)) found.push_back(*one);
  }
  return found;
}

struct Conversation {
  std::unique_ptr<Session> host = std::make_unique<Session>(Role::kHost, make_hello("nodal test"));
  std::unique_ptr<Session> rig = std::make_unique<Session>(Role::kRig, make_hello("nodald test"));
  std::vector<Event> at_host;
  std::vector<Event> at_rig;

  /// Moves bytes both ways until neither end has output. The test checks for errors of a dead session
  /// itself.
  void run() {
    while (move(*host, *rig, at_rig) + move(*rig, *host, at_host) > 0) {}
  }

  static std::size_t move(Session& from, Session& to, std::vector<Event>& events) {
    const auto bytes = take_output(from);
    if (!bytes.empty()) (void)to.receive(bytes);
    for (auto& event : take_events(to)) events.push_back(std::move(event));
    return bytes.size();
  }
};

}  // namespace nodal
