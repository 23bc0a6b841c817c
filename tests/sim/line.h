// A host's end of one connection to the rig: the link, its session, and the bytes in both directions.
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

  /// The next event from the rig; reads the link as far as necessary.
  std::optional<nodal::Event> take();
  /// Writes the session's output, as far as the link accepts it.
  void write();
  /// Writes bytes that do not come from the session. Returns false if the link did not accept all of them.
  bool write_raw(std::span<const std::uint8_t> bytes);
  /// The bytes of the last write().
  const std::vector<std::uint8_t>& recently_written() const { return recently_written_; }

  bool dead() const { return gone_ || session_.error(); }
  /// Stops sending and receiving; the destructor closes the link.
  void leave() { gone_ = true; }

 private:
  std::unique_ptr<hal::LinkPort> link_;
  Session session_;
  std::vector<std::uint8_t> recently_written_;
  bool gone_ = false;
};

}  // namespace nodal::swarm
