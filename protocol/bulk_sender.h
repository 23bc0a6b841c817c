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

/// The sending half of a session's streams: what is offered, what credit there is, whose turn it is.
///
/// Threading: thread-bound.
/// Ownership: holds bodies until they are sent or dropped.
/// Errors: kOverload, kWrongState, kTooLarge; kProtocol for a peer that breaks the rules of credit.
class BulkSender {
 public:
  /// A session's two ends number their streams apart: first, first + 2, ...
  explicit BulkSender(StreamId first) : next_id_(first) {}

  Result<StreamId> open(StreamPolicy policy);
  Status offer(StreamId stream, BulkItem item);
  /// After what is pending; with an error, at once.
  void close(StreamId stream, std::optional<Error> error);
  std::optional<StreamCounts> counts(StreamId stream) const;

  /// The peer says how much it takes in all. A credit for a stream that is gone crossed our close: no error.
  Status credit(StreamId stream, std::uint64_t allowed);
  /// The peer wants no more. False when the stream was gone already.
  bool stop(StreamId stream, const Error& why);

  /// A frame's worth of one stream: its frame payload is `head` followed by `slice`.
  struct Piece {
    StreamId stream = 0;
    std::vector<std::uint8_t> head;  ///< the piece header, and the meta in an item's first piece
    SharedBytes slice;
  };
  /// The next piece that credit lets go, streams in turn; nothing when none may. A stream whose body cannot be read is
  /// closed with the error, and next_closed() has it.
  std::optional<Piece> next_piece();

  /// A stream that has said all: its last word is due.
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
    std::uint64_t sent = 0;  // of meta and body
    bool begun = false;      // no longer to be replaced: a piece of it is out
    std::uint64_t total() const;
  };
  struct Stream {
    StreamPolicy policy = StreamPolicy::kLossless;
    std::deque<Pending> queue;  // the front one may have begun
    StreamCounts counts;
    std::uint64_t sent = 0;
    std::uint64_t allowed = 0;
    bool closing = false;
    std::optional<Error> error;
  };
  Result<Piece> cut(StreamId id, Stream& stream);

  std::map<StreamId, Stream> streams_;
  StreamId next_id_;
  StreamId last_served_ = 0;
};

}  // namespace nodal
