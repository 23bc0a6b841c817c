// Bulk streams: items (one raymap, one upload, one take's file) cut into pieces of at most 64 KiB, with
// credits. The sender opens a stream with a policy, the receiver grants credits as it consumes.
//
// A bulk frame's payload is a piece header and bytes of the item, which is its meta followed by its body:
//
//   0  u64  item number: counts the items offered on the stream from 0; a gap is items dropped
//   8  u64  total bytes of the item, meta included
//  16  u64  offset of this piece in the item
//  24  u32  bytes of meta at the item's beginning
//
// Credits count item bytes over the stream's life: wire::StreamCredit.allowed says how many may have been
// sent in all, so that a credit repeated or merged with a later one does no harm.
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
  kLossless = 1,  ///< every item arrives; the sender's queue is bounded and says when it is full
  kLatest = 2,    ///< a newer item replaces one that has not begun to go out; drops are counted and told
};

/// Bytes that several sessions send at once without a copy, and what keeps them where they are. Null: none.
class SharedBytes {
 public:
  SharedBytes() = default;
  /// `bytes` stay in place and unchanged as long as `owner` lives.
  SharedBytes(std::shared_ptr<const void> owner, std::span<const std::uint8_t> bytes)
      : owner_(std::move(owner)), bytes_(bytes) {}
  /// All bytes of a vector that nobody changes any more.
  template <class Vector>
  requires std::convertible_to<const Vector&, std::span<const std::uint8_t>> SharedBytes(std::shared_ptr<Vector> vector)
      : bytes_(vector ? std::span<const std::uint8_t>(*vector) : bytes_) {
    owner_ = std::move(vector);
  }

  explicit operator bool() const { return owner_ != nullptr; }
  std::span<const std::uint8_t> operator*() const { return bytes_; }
  std::size_t size() const { return bytes_.size(); }
  /// The same owner's bytes from `offset` on.
  SharedBytes part(std::size_t offset, std::size_t count) const { return {owner_, bytes_.subspan(offset, count)}; }

 private:
  std::shared_ptr<const void> owner_;
  std::span<const std::uint8_t> bytes_;
};

/// A body that is read piece by piece while it is sent, such as a file larger than memory.
///
/// Threading: called by the thread of the session that sends it; read() delays everything that this thread does.
/// Ownership: the stream holds it until the item is sent or dropped.
class BodySource {
 public:
  virtual ~BodySource() = default;
  /// In bytes. The same in every call.
  virtual std::uint64_t size() const = 0;
  /// Fills all of `bytes`, at most kMaxPieceBytes, with the body's from `offset` on. An error closes the stream with that
  /// error; the receiver then has a part of the item.
  virtual Status read(std::uint64_t offset, std::span<std::uint8_t> bytes) = 0;
};

/// What is offered to a stream: a small serialized message about it, and its bytes from `offset` on.
struct BulkItem {
  std::string meta;                                             ///< such as a wire::RaymapHeader; at most kMaxMetaBytes
  std::variant<SharedBytes, std::shared_ptr<BodySource>> body;  ///< null: an empty body
  std::uint64_t offset = 0;                                     ///< the body goes from here; at most its size
};

inline constexpr std::size_t kPieceHeaderBytes = 28;
inline constexpr std::size_t kMaxPieceBytes = kMaxBulkBytes - kPieceHeaderBytes;
/// The meta is always whole in an item's first piece.
inline constexpr std::size_t kMaxMetaBytes = 4096;
inline constexpr std::uint64_t kMaxItemBytes = std::uint64_t{1} << 40;
/// What a receiver lets a sender have under way on one stream before anything is consumed. Small for live
/// streams, since everything under way is already old; a rig has less memory to lend than a host. A window
/// is never less than kMaxMetaBytes * 4, so that an item's first piece can always go.
inline constexpr std::uint64_t kStreamWindowBytes = 1U << 20;
inline constexpr std::uint64_t kHostLosslessWindowBytes = 4U << 20;
inline constexpr std::size_t kMaxStreams = 16;  ///< open at once, each way
/// Items a lossless stream holds before offer() says kOverload.
inline constexpr std::size_t kLosslessQueueItems = 32;

/// A part of an item as it arrived. Pieces of an item come in order and without gaps.
struct BulkPiece {
  StreamId stream = 0;
  std::uint64_t item = 0;     ///< its number among those offered
  std::uint64_t dropped = 0;  ///< items of the stream dropped before this one, so far
  std::string meta;           ///< the item's; only with its first piece (offset 0)
  std::uint64_t offset = 0;   ///< of data in the body as it is sent
  std::uint64_t total = 0;    ///< bytes of the body as it is sent
  std::vector<std::uint8_t> data;
  bool first = false;
  bool last = false;  ///< the item is whole with this piece
};

/// offered = delivered + dropped + pending, at any time.
struct StreamCounts {
  std::uint64_t offered = 0;
  std::uint64_t delivered = 0;  ///< every byte handed to output()
  std::uint64_t dropped = 0;
  std::uint64_t pending = 0;  ///< waiting, or begun and not finished
  std::uint64_t bytes = 0;    ///< of items, handed to output()
};

}  // namespace nodal
