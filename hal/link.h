#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "hal/wake_ups.h"
#include "protocol/base/result.h"

namespace nodal::hal {

/// The process at the other end, as reported by the kernel.
struct PeerIdentity {
  std::uint32_t user = 0;    ///< uid
  std::int32_t process = 0;  ///< pid when it connected
  friend bool operator==(const PeerIdentity&, const PeerIdentity&) = default;
};

/// One byte stream to a peer: a socket, a USB bulk pair, a pipe.
/// Every call returns at once; message boundaries are not kept.
///
/// Threading: thread-bound to its stage.
/// Ownership: closes with the object.
/// Errors: kLinkClosed is final, and is returned only after every received byte was read.
class LinkPort {
 public:
  virtual ~LinkPort() = default;
  /// Reads available bytes into `into`; 0 if there are none now.
  virtual Result<std::size_t> read(std::span<std::uint8_t> into) = 0;
  /// Writes bytes of `from` and returns their number; 0 if the peer does not read now.
  virtual Result<std::size_t> write(std::span<const std::uint8_t> from) = 0;
  /// Adds what wakes a thread when read() or write() can go on.
  virtual void add_wake_ups(WakeUps& to, bool to_read, bool to_write) const = 0;
  /// The peer's name for messages: "unix:/run/nodal.sock", "usb:1-2".
  virtual const std::string& peer() const = 0;
  /// The process that connected; nothing where the kernel does not report it, as for pipes and USB.
  virtual std::optional<PeerIdentity> identity() const = 0;
};

/// Where hosts connect.
///
/// Threading: thread-bound to its stage.
/// Ownership: hands out links that outlive it.
/// Errors: kIo.
class LinkListenerPort {
 public:
  virtual ~LinkListenerPort() = default;
  /// A new link, or null if no peer is waiting.
  virtual Result<std::unique_ptr<LinkPort>> accept() = 0;
  /// Adds what wakes a thread when a peer waits.
  virtual void add_wake_ups(WakeUps& to) const = 0;
};

}  // namespace nodal::hal
