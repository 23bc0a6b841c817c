#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "protocol/base/result.h"
#include "protocol/bulk.h"

namespace nodal {

/// The receiving half of a session's streams: checks that pieces arrive in order and within their credit, and computes
/// which credits to grant.
///
/// Threading: thread-bound.
/// Ownership: none.
/// Errors: kProtocol for every broken rule; each is final for the session.
class BulkReceiver {
 public:
  /// The peer numbers its streams first, first + 2, ...
  explicit BulkReceiver(StreamId first, std::uint64_t lossless_window = kStreamWindowBytes)
      : next_id_(first), lossless_window_(lossless_window) {}

  Status open(StreamId stream, std::uint32_t policy);
  /// Handles a bulk frame's payload; nothing if the stream was stopped and the piece is discarded.
  Result<std::optional<BulkPiece>> piece(StreamId stream, std::span<const std::uint8_t> payload);
  /// The sender has closed the stream. Returns false if this end had stopped it.
  Result<bool> close(StreamId stream, std::uint64_t offered, std::uint64_t dropped, bool torn);
  /// Requests that the peer sends no more. Returns false if there is no such stream.
  bool stop(StreamId stream);

  /// The program has consumed this piece: its bytes may be granted again.
  void consumed(const BulkPiece& piece);
  /// A stream whose credit has grown enough to be sent, and its new total.
  struct Credit {
    StreamId stream = 0;
    std::uint64_t allowed = 0;
  };
  std::optional<Credit> next_credit();

  /// Bytes of items in complete frames, on all streams.
  std::uint64_t received_bytes() const { return received_bytes_; }
  /// The same for one stream, while it is open; 0 afterwards.
  std::uint64_t received_bytes(StreamId stream) const;
  /// Whether an item is incomplete on a stream that is still open.
  bool inside_item() const;

 private:
  struct Stream {
    std::uint64_t window = kStreamWindowBytes;
    StreamPolicy policy = StreamPolicy::kLossless;
    bool stopped = false;
    std::uint64_t received = 0;  // item bytes in total
    std::uint64_t consumed = 0;
    std::uint64_t credit_sent = 0;  // the newest
    // The incomplete item, if next_offset is not 0, and the expected continuation.
    std::uint64_t item = 0;
    std::uint64_t total = 0;
    std::uint64_t next_offset = 0;
    std::uint32_t meta = 0;
    std::uint64_t next_item = 0;
    std::uint64_t whole = 0;  // completely received items
  };

  struct PieceHeader {
    std::uint64_t item, total, offset;
    std::uint32_t meta;
  };
  static Status check_order(const Stream& stream, const PieceHeader& header, std::size_t bytes);

  std::map<StreamId, Stream> streams_;
  StreamId next_id_;
  std::uint64_t lossless_window_;
  std::uint64_t received_bytes_ = 0;
};

}  // namespace nodal
