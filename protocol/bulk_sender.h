#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/bulk.h"

namespace nodal {

/// The sending half of a session's streams: offered items, their credit, and the order in which streams send.
///
/// Threading: thread-bound.
/// Ownership: holds bodies until they are sent or dropped.
/// Errors: kOverload, kWrongState, kTooLarge; kProtocol if the peer breaks the rules of credit.
class BulkSender {
 public:
  /// The two ends of a session use different numbers for their streams: first, first + 2, ...
  explicit BulkSender(StreamId first) : next_id_(first) {}

  Result<StreamId> open(StreamPolicy policy);
  Status offer(StreamId stream, BulkItem item);
  /// Closes after all pending items are sent; with an error, at once.
  void close(StreamId stream, std::optional<Error> error);
  std::optional<StreamCounts> counts(StreamId stream) const;

  /// The peer grants `allowed` bytes in total. Credit for a closed stream is no error: it may cross our close.
  Status credit(StreamId stream, std::uint64_t allowed);
  /// The peer wants no more items. Returns false if the stream was closed already.
  bool stop(StreamId stream, const Error& why);

  /// One frame of one stream: its payload is `head` followed by `slice`.
  struct Piece {
    StreamId stream = 0;
    std::vector<std::uint8_t> head;  ///< the piece header, and the meta in an item's first piece
    SharedBytes slice;
  };
  /// The next piece for which there is credit, streams in round robin; nothing if there is none. If a body cannot be
  /// read, its stream is closed with the error, which next_closed() returns. The link must have taken the piece before.
  std::optional<Piece> next_piece();
  /// The link has taken so many bytes of the newest piece's meta and body, in total; `whole`: all of its frame.
  void taken(std::uint64_t bytes, bool whole);
  /// Bytes of items on all streams that the link has taken.
  std::uint64_t taken_bytes() const { return taken_bytes_; }

  /// A stream whose items are all sent; its close message is due.
  struct Closed {
    StreamId stream = 0;
    StreamCounts counts;
    std::optional<Error> error;
  };
  std::optional<Closed> next_closed();

 private:
  struct Pending {
    std::uint64_t number = 0;
    BulkItem item;
    std::uint64_t sent = 0;  // bytes of meta and body, in pieces
    bool begun = false;      // a piece of it has been sent, so it can no longer be replaced
    std::uint64_t total() const;
    bool all_sent() const { return begun && sent == total(); }
  };
  struct Stream {
    StreamPolicy policy = StreamPolicy::kLossless;
    std::deque<Pending> queue;  // sending of the front item may have begun
    StreamCounts counts;
    std::uint64_t sent = 0;  // bytes of the stream that were sent in pieces
    std::uint64_t allowed = 0;
    bool closing = false;
    std::optional<Error> error;
  };
  // The piece that the link takes now.
  struct OnLink {
    StreamId stream = 0;
    std::uint64_t taken = 0;
  };
  Result<Piece> cut(StreamId id, Stream& stream);

  std::map<StreamId, Stream> streams_;
  StreamId next_id_;
  StreamId last_served_ = 0;
  std::optional<OnLink> on_link_;
  std::uint64_t taken_bytes_ = 0;
};

}  // namespace nodal
