// Uploads that survive a dropped link: both ends identify the document by its SHA-256, the rig reports how much of it
// it has, and the host continues from that byte.
//
//   host: UploadBegin{length, sha256}         rig: UploadState{offset}
//   host: one item on a lossless stream: meta UploadPart{sha256, offset}, body the bytes from offset on
//   host: UploadCommit{sha256}                rig: take(), then uses the document
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

/// The 32 bytes of a message's field, or kBadValue.
Result<Sha256> sha256_from_wire(const std::string& bytes);
std::string sha256_to_wire(const Sha256& digest);

struct UploadLimits {
  std::uint64_t document_bytes = 1U << 20;  ///< the longest accepted document
  std::size_t documents = 4;                ///< incomplete at once; beyond, the least recently used is dropped
  std::size_t documents_of_owner = 2;       ///< the same per owner; beyond, one of that owner's documents is dropped
};

/// The rig's half: incomplete documents by their SHA-256. It outlives every session, so that an upload can continue
/// after the link dropped; two clients that send the same document share it.
///
/// Threading: thread-bound to control.
/// Ownership: owns the bytes until take(); at most limits.documents * limits.document_bytes.
/// Errors: kTooLarge, kBadValue (a changed length, a part past the end), kNotFound (never begun), kTruncated (taken
///   before it is complete), kChecksum (complete, but another SHA-256). After kChecksum the document is dropped, so
///   that the next attempt starts from byte 0.
class UploadReceiver {
 public:
  explicit UploadReceiver(UploadLimits limits = {});

  /// The number of the client that uploads. kNoOwner: that client has disconnected.
  using Owner = std::uint64_t;
  static constexpr Owner kNoOwner = 0;

  /// Returns the offset from which to continue. Bytes of a document with the same name are kept. Room is made first
  /// from documents without an owner, so that a client that begins uploads in a loop evicts only its own.
  Result<std::uint64_t> begin(const Sha256& sha256, std::uint64_t length, Owner owner = kNoOwner);
  /// The owner has disconnected. Its documents are kept for other clients that send them, until room is needed.
  void leave(Owner owner);
  /// Adds bytes of the document at `offset`. Bytes that are already there are ignored; a gap is kBadValue.
  Status write(const Sha256& sha256, std::uint64_t offset, std::span<const std::uint8_t> bytes);
  /// Returns the complete, checked document and removes it from here.
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
  std::list<Document> documents_;  // most recently used first
};

/// The document and offset of the current item of a stream; the rig keeps one for every open upload stream.
class UploadStream {
 public:
  /// Passes a piece of an upload stream to the receiver.
  Status piece(const BulkPiece& piece, UploadReceiver& receiver);

 private:
  std::optional<Sha256> sha256_;
  std::uint64_t offset_ = 0;
};

/// The host's half: the messages in the order in which they are sent.
class UploadSender {
 public:
  explicit UploadSender(SharedBytes document);

  wire::UploadBegin begin() const;
  /// The item to offer on a lossless stream after the rig's answer. kProtocol if the answer's offset is past the end.
  Result<BulkItem> item(std::uint64_t offset) const;
  wire::UploadCommit commit() const;
  const Sha256& sha256() const { return sha256_; }

 private:
  SharedBytes document_;
  Sha256 sha256_;
};

}  // namespace nodal
