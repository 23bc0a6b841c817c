// Hosts as a fuzzer has them: one that keeps the protocol and asks anything, and one that writes whatever bytes.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hal/sim/link.h"
#include "protocol/base/units.h"
#include "protocol/session.h"

namespace nodal::fuzz {

/// A host that keeps the protocol. It remembers when it asked what, so that a reply that never comes is seen.
///
/// Threading: thread-bound.
/// Ownership: owns its end of the link.
/// Errors: none; a conversation that has ended is dead().
class Guest {
 public:
  Guest(hal::sim::SimLinkListener& listener, std::string name);

  /// Sends a request under an id of its own; the id, or nothing when the session does not take it.
  std::optional<std::uint64_t> post(wire::Request request, Duration served);
  /// Opens a lossless stream and sends one item on it, as an upload does.
  void send_item(std::string meta, std::vector<std::uint8_t> body);
  /// Moves bytes both ways. True when any moved.
  bool pump();
  /// Stops reading, or goes on. What was asked until then has its second again.
  void set_reading(bool reading, Duration served);
  bool reading() const { return reading_; }
  bool dead() const { return gone_ || session_.error() != nullptr; }

  /// Takes the reply to a request, once it is there.
  std::optional<wire::Reply> take_reply(std::uint64_t id);
  /// The request that has waited longest, in time during which the rig was served; nothing when it cannot be answered
  /// because this host does not read.
  std::optional<Duration> longest_wait(Duration served) const;
  std::uint64_t replies() const { return replies_seen_; }

 private:
  struct Asked {
    Duration at;
    bool may_take_long = false;  ///< the blend must take a table first, and a lossless client may hold it up
  };
  bool read_some();

  std::unique_ptr<hal::sim::SimLink> link_;
  Session session_;
  std::map<std::uint64_t, Asked> open_;
  std::map<std::uint64_t, wire::Reply> replies_;
  std::uint64_t next_id_ = 1, replies_seen_ = 0;
  bool reading_ = true, gone_ = false;
};

/// A host that says hello and then writes frames of any type and content, or bytes that are none.
///
/// Threading: thread-bound.
/// Ownership: owns its end of the link.
/// Errors: none.
class Vandal {
 public:
  explicit Vandal(hal::sim::SimLinkListener& listener);

  void send_frame(std::uint8_t type, std::uint32_t stream, std::span<const std::uint8_t> payload);
  void send_bytes(std::span<const std::uint8_t> bytes);
  /// Throws away what comes, and writes what waits. True when any moved.
  bool pump();
  bool dead() const { return gone_; }

 private:
  std::unique_ptr<hal::sim::SimLink> link_;
  std::vector<std::uint8_t> unsent_;
  std::uint32_t sequence_ = 0;
  bool gone_ = false;
};

}  // namespace nodal::fuzz
