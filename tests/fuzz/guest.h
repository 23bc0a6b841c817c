// The fuzzer's hosts: one that follows the protocol and sends any request, and one that writes any bytes.
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

/// A host that follows the protocol. It records the time of every request, so that a missing reply is detected.
///
/// Threading: thread-bound.
/// Ownership: owns its end of the link.
/// Errors: none; dead() is true after the conversation has ended.
class Guest {
 public:
  Guest(hal::sim::SimLinkListener& listener, std::string name);

  /// Sends a request with its own id; returns the id, or nothing if the session refuses it.
  std::optional<std::uint64_t> post(wire::Request request, Duration served);
  /// Opens a lossless stream and sends one item on it, as an upload does.
  void send_item(std::string meta, std::vector<std::uint8_t> body);
  /// Moves bytes in both directions. Returns whether any moved.
  bool pump();
  /// Stops or resumes reading. The time limit of pending requests starts again.
  void set_reading(bool reading, Duration served);
  bool reading() const { return reading_; }
  bool dead() const { return gone_ || session_.error() != nullptr; }

  /// Takes the reply to a request, if it has arrived.
  std::optional<wire::Reply> take_reply(std::uint64_t id);
  /// How long the oldest request has waited while the rig was stepped; nothing if it cannot be answered because this
  /// host does not read.
  std::optional<Duration> longest_wait(Duration served) const;
  std::uint64_t replies() const { return replies_seen_; }

 private:
  struct Asked {
    Duration at;
    bool may_take_long = false;  ///< the blend must first use a new table, and a lossless client may delay that
  };
  bool read_some();

  std::unique_ptr<hal::sim::SimLink> link_;
  Session session_;
  std::map<std::uint64_t, Asked> open_;
  std::map<std::uint64_t, wire::Reply> replies_;
  std::uint64_t next_id_ = 1, replies_seen_ = 0;
  bool reading_ = true, gone_ = false;
};

/// A host that sends a Hello and then frames of any type and content, or invalid bytes.
///
/// Threading: thread-bound.
/// Ownership: owns its end of the link.
/// Errors: none.
class Vandal {
 public:
  explicit Vandal(hal::sim::SimLinkListener& listener);

  void send_frame(std::uint8_t type, std::uint32_t stream, std::span<const std::uint8_t> payload);
  void send_bytes(std::span<const std::uint8_t> bytes);
  /// Discards received bytes and writes pending ones. Returns whether any moved.
  bool pump();
  bool dead() const { return gone_; }

 private:
  std::unique_ptr<hal::sim::SimLink> link_;
  std::vector<std::uint8_t> unsent_;
  std::uint32_t sequence_ = 0;
  bool gone_ = false;
};

}  // namespace nodal::fuzz
