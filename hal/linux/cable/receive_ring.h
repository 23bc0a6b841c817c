// Transfers that receive a session's records, at either end of the cable.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "hal/linux/cable/records.h"
#include "protocol/base/result.h"

namespace nodal::hal::cable {

/// kTransfers slots, queued and read in turn; a slot is queued again when its bytes were read, so a peer that sends
/// without being read comes to a stop.
///
/// Threading: thread-bound.
/// Ownership: the buffers are the caller's; a slot's must stay as it is from received() until the slot is queued again.
class ReceiveRing {
 public:
  /// `queue` queues a slot's transfer; false if it cannot, after which no other is queued.
  explicit ReceiveRing(std::function<bool(std::size_t slot)> queue) : queue_(std::move(queue)) {}

  /// Forgets everything received and queues all slots. No slot may be queued.
  void begin(std::uint16_t session);
  /// The slot's transfer has ended with these bytes.
  void received(std::size_t slot, std::span<const std::uint8_t> bytes);
  /// No slot is queued any more.
  void stop() { stopped_ = true; }

  /// Reads headers up to the next byte of the stream, so that ended() and violation() are true to what has arrived.
  void advance();
  /// The next bytes of the stream, at most `most`; empty if there are none now. Valid until the next call.
  std::span<const std::uint8_t> next_bytes(std::size_t most);
  /// Whether the peer has ended the session and all its bytes were read.
  bool ended() const { return reader_.ended(); }
  /// A record that breaks the rules; nothing after it is read.
  const std::optional<Error>& violation() const { return violation_; }
  std::size_t queued() const { return queued_; }
  /// Whether next_bytes() has something to read or to report now.
  bool ready() const;

 private:
  struct Slot {
    bool queued = false;
    std::span<const std::uint8_t> bytes;  ///< received and not yet read
  };
  void queue(std::size_t slot);

  std::function<bool(std::size_t)> queue_;
  std::array<Slot, kTransfers> slots_;
  std::size_t next_ = 0;
  std::size_t queued_ = 0;
  bool stopped_ = true;
  RecordReader reader_{0};
  std::span<const std::uint8_t> payload_;  ///< unread part of the current record
  std::optional<Error> violation_;
};

}  // namespace nodal::hal::cable
