// A host's end of one connection to the rig: the link, the session on it, and the bytes either way.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hal/link.h"
#include "protocol/session.h"

namespace nodal::swarm {

/// Threading: thread-bound.
/// Ownership: owns the link.
/// Errors: dead() after the first; it is final.
class Line {
 public:
  Line(std::unique_ptr<hal::LinkPort> link, std::string software)
      : link_(std::move(link)), session_(Role::kHost, make_hello(std::move(software))) {}

  Session& session() { return session_; }

  /// The next event from the rig. Reads the link as far as that needs.
  std::optional<nodal::Event> take();
  /// Writes what the session has to say, as far as the link takes it.
  void write();
  /// Writes bytes that no session says. False when the link did not take all of them.
  bool write_raw(std::span<const std::uint8_t> bytes);
  /// What write() wrote last.
  const std::vector<std::uint8_t>& recently_written() const { return recently_written_; }

  bool dead() const { return gone_ || session_.error(); }
  /// Sends and receives no more; the link closes with the object.
  void leave() { gone_ = true; }

 private:
  std::unique_ptr<hal::LinkPort> link_;
  Session session_;
  std::vector<std::uint8_t> recently_written_;
  bool gone_ = false;
};

}  // namespace nodal::swarm
