// The frames that one end of a session sends, in the order in which the link takes them.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocol/bulk_receiver.h"
#include "protocol/bulk_sender.h"
#include "protocol/framing.h"

namespace nodal {

/// Queued control frames go first, then pings, credits and the ends of streams; a piece of a stream goes when nothing
/// else is to be sent. So a control frame waits for at most one piece, the one that is being written.
///
/// Threading: thread-bound.
/// Ownership: holds offered bodies until they are sent or dropped.
/// Errors: none of its own; those of BulkSender.
class OutgoingFrames {
 public:
  /// This end numbers its streams first, first + 2, ...
  explicit OutgoingFrames(StreamId first) : streams_(first) {}

  void push(FrameType type, StreamId stream, std::string payload);
  /// Bytes of control frames that wait.
  std::size_t queued_bytes() const { return queued_bytes_; }
  void ping() { ping_due_ = true; }
  /// One answer serves any number of pings.
  void answer_ping() { pong_due_ = true; }

  BulkSender& streams() { return streams_; }
  const BulkSender& streams() const { return streams_; }
  /// Releases all bodies. From now on, only control frames are sent.
  void end_streams();

  /// Bytes to write next; empty if there are none. Valid until the next non-const call. `received` says which credits
  /// are due.
  std::span<const std::uint8_t> output(BulkReceiver& received);
  /// The link has taken so many bytes of output().
  void sent(std::size_t bytes);

 private:
  struct Queued {
    FrameType type;
    StreamId stream;
    std::string payload;
  };

  void next_front(BulkReceiver& received);
  void append(FrameType type, StreamId stream, const std::string& payload);
  void append_closes();
  void append_piece(BulkSender::Piece piece);
  std::size_t front_bytes() const { return front_.size() + front_slice_.size(); }

  std::deque<Queued> queue_;
  std::size_t queued_bytes_ = 0;
  bool ping_due_ = false;
  bool pong_due_ = false;
  bool ended_ = false;  ///< only control frames are sent
  BulkSender streams_;
  std::uint32_t sequence_ = 0;
  std::vector<std::uint8_t> front_;  ///< the frames that are being written, without the slice
  SharedBytes front_slice_;          ///< their last bytes, if they are a piece
  std::size_t front_sent_ = 0;
  std::optional<std::size_t> front_item_;  ///< where the item's bytes begin, if it is a piece
};

}  // namespace nodal
