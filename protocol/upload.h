// Uploads that survive a dropped link: both ends name the document by its SHA-256, the rig says how much of
// it is already there, the host goes on from that byte.
//
//   host: UploadBegin{length, sha256}         rig: UploadState{offset}
//   host: one item on a lossless stream: meta UploadPart{sha256, offset}, body the bytes from offset on
//   host: UploadCommit{sha256}                rig: take(), then whatever the document is for
#pragma once

#include <cstdint>
#include <list>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "protocol/bulk.h"
#include "protocol/nodal.pb.h"

namespace nodal {

/// 32 bytes of a message, or kBadValue.
Result<Sha256> sha256_from_wire(const std::string& bytes);
std::string sha256_to_wire(const Sha256& digest);

struct UploadLimits {
  std::uint64_t document_bytes = 1U << 20;  ///< the longest document
  std::size_t documents = 4;                ///< incomplete at once; then the least recently used makes room
  std::size_t documents_of_owner = 2;       ///< likewise for one owner, of whose documents one then makes room
};

/// The rig's half: incomplete documents by their SHA-256. It outlives every session, so that an upload resumes where
/// the link dropped it; two clients that send the same document share it.
///
/// Threading: thread-bound to control.
/// Ownership: owns the bytes until take(); at most limits.documents * limits.document_bytes.
/// Errors: kTooLarge, kBadValue (a length that changed, a part past the end), kNotFound (never begun),
///   kTruncated (taken before it is whole), kChecksum (whole, but with another SHA-256). After kChecksum the
///   document is forgotten, so that the next attempt starts from byte 0.
class UploadReceiver {
 public:
  explicit UploadReceiver(UploadLimits limits = {});

  /// The number of the client that uploads. kNoOwner: that client has left.
  using Owner = std::uint64_t;
  static constexpr Owner kNoOwner = 0;

  /// The offset to resume from. Bytes of a document of the same name are kept. Room is made first from documents without
  /// owner, so that a client that begins uploads in a loop evicts only its own.
  Result<std::uint64_t> begin(const Sha256& sha256, std::uint64_t length, Owner owner = kNoOwner);
  /// The owner has left. Its documents stay for a client that sends the same one, until their room is needed.
  void leave(Owner owner);
  /// Bytes of the document at `offset`. Bytes that are there already are passed over, a gap is kBadValue.
  Status write(const Sha256& sha256, std::uint64_t offset, std::span<const std::uint8_t> bytes);
  /// The whole document, checked; it is forgotten here.
  Result<std::vector<std::uint8_t>> take(const Sha256& sha256);
  void forget(const Sha256& sha256);

 private:
  struct Document {
    Sha256 sha256{};
    std::uint64_t length = 0;
    std::vector<std::uint8_t> bytes;
    Owner owner = kNoOwner;
  };
  void make_room(Owner owner);
  std::list<Document>::iterator find(const Sha256& sha256);

  UploadLimits limits_;
  std::list<Document> documents_;  // the most recently used in front
};

/// The document and offset of the item under way on a stream; the rig keeps one for every open upload stream.
class UploadStream {
 public:
  /// Gives a piece of an upload's stream to the receiver.
  Status piece(const BulkPiece& piece, UploadReceiver& receiver);

 private:
  std::optional<Sha256> sha256_;
  std::uint64_t offset_ = 0;
};

/// The host's half, as messages in the order they go.
class UploadSender {
 public:
  explicit UploadSender(SharedBytes document);

  wire::UploadBegin begin() const;
  /// What to offer on a lossless stream after the rig's answer. kProtocol when its offset is past the end.
  Result<BulkItem> item(std::uint64_t offset) const;
  wire::UploadCommit commit() const;
  const Sha256& sha256() const { return sha256_; }

 private:
  SharedBytes document_;
  Sha256 sha256_;
};

}  // namespace nodal
