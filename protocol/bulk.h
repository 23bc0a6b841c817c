// Bulk streams: items (one raymap, one upload, one take's file) in pieces of at most 64 KiB, with credits. The sender
// opens a stream with a policy; the receiver grants credits as it consumes.
//
// A bulk frame's payload is a piece header and bytes of the item. An item is its meta followed by its body:
//
//   0  u64  item number: counts the items offered on the stream from 0; a gap means dropped items
//   8  u64  total bytes of the item, meta included
//  16  u64  offset of this piece in the item
//  24  u32  bytes of meta at the item's beginning
//
// Credits count item bytes over the stream's life: wire::StreamCredit.allowed is the total that may have been sent, so
// that a credit that is repeated, or merged with a later one, does no harm.
#pragma once

#include <concepts>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/framing.h"

namespace nodal {

using StreamId = std::uint32_t;

enum class StreamPolicy : std::uint8_t {
  kLossless = 1,  ///< every item arrives; offer() reports when the sender's bounded queue is full
  kLatest = 2,    ///< a newer item replaces one whose sending has not begun; drops are counted and reported
};

/// Bytes that several sessions send at once without a copy, and the owner that keeps them alive. Null: none.
class SharedBytes {
 public:
  SharedBytes() = default;
  /// `bytes` must stay in place and unchanged as long as `owner` lives.
  SharedBytes(std::shared_ptr<const void> owner, std::span<const std::uint8_t> bytes)
      : owner_(std::move(owner)), bytes_(bytes) {}
  /// All bytes of a vector that is never changed again.
  template <class Vector>
  requires std::convertible_to<const Vector&, std::span<const std::uint8_t>> SharedBytes(std::shared_ptr<Vector> vector)
      : bytes_(vector ? std::span<const std::uint8_t>(*vector) : std::span<const std::uint8_t>()) {
    owner_ = std::move(vector);
  }

  explicit operator bool() const { return owner_ != nullptr; }
  std::span<const std::uint8_t> operator*() const { return bytes_; }
  std::size_t size() const { return bytes_.size(); }
  /// A part of the bytes, with the same owner.
  SharedBytes part(std::size_t offset, std::size_t count) const { return {owner_, bytes_.subspan(offset, count)}; }

 private:
  std::shared_ptr<const void> owner_;
  std::span<const std::uint8_t> bytes_;
};

/// A body that is read in pieces while it is sent, such as a file larger than memory.
///
/// Threading: called by the thread of the session that sends it; while read() runs, that thread does nothing else.
/// Ownership: the stream holds it until the item is sent or dropped.
class BodySource {
 public:
  virtual ~BodySource() = default;
  /// In bytes. Every call returns the same value.
  virtual std::uint64_t size() const = 0;
  /// Fills all of `bytes`, at most kMaxPieceBytes, from `offset` of the body. An error closes the stream with that
  /// error; the receiver then has a part of the item.
  virtual Status read(std::uint64_t offset, std::span<std::uint8_t> bytes) = 0;
};

/// An item offered to a stream: a small serialized message that describes it, and its bytes from `offset` on.
struct BulkItem {
  std::string meta;                                             ///< such as a wire::RaymapHeader; at most kMaxMetaBytes
  std::variant<SharedBytes, std::shared_ptr<BodySource>> body;  ///< null: an empty body
  std::uint64_t offset = 0;                                     ///< the body is sent from here; at most its size
};

inline constexpr std::size_t kPieceHeaderBytes = 28;
inline constexpr std::size_t kMaxPieceBytes = kMaxBulkBytes - kPieceHeaderBytes;
/// An item's first piece always contains the whole meta.
inline constexpr std::size_t kMaxMetaBytes = 4096;
inline constexpr std::uint64_t kMaxItemBytes = std::uint64_t{1} << 40;
/// How many bytes a sender may send on one stream before the receiver consumes any. Small for live streams, because
/// queued data gets old, and small on a rig, which has less memory than a host. A window is at least kMaxMetaBytes * 4,
/// so that an item's first piece can always be sent.
inline constexpr std::uint64_t kStreamWindowBytes = 1U << 20;
inline constexpr std::uint64_t kHostLosslessWindowBytes = 4U << 20;
inline constexpr std::size_t kMaxStreams = 16;  ///< open at once, per direction
/// Items that a lossless stream queues before offer() returns kOverload.
inline constexpr std::size_t kLosslessQueueItems = 32;

/// A received part of an item. Pieces of an item arrive in order and without gaps.
struct BulkPiece {
  StreamId stream = 0;
  std::uint64_t item = 0;     ///< its number among the offered items
  std::uint64_t dropped = 0;  ///< items of the stream that were dropped before this one, in total
  std::string meta;           ///< the item's meta; only in its first piece (offset 0)
  std::uint64_t offset = 0;   ///< position of `data` in the body as sent
  std::uint64_t total = 0;    ///< size of the body as sent
  std::vector<std::uint8_t> data;
  bool first = false;
  bool last = false;  ///< this piece completes the item
};

/// At any time: offered = delivered + dropped + pending.
struct StreamCounts {
  std::uint64_t offered = 0;
  std::uint64_t delivered = 0;  ///< the link has taken every byte of the item
  std::uint64_t dropped = 0;
  std::uint64_t pending = 0;  ///< waiting, or partly taken by the link
  std::uint64_t bytes = 0;    ///< bytes of items that the link has taken
};

}  // namespace nodal
