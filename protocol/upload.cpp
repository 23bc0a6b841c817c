#include "protocol/upload.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace nodal {
namespace {

std::string short_name(const Sha256& sha256) { return "upload " + to_hex(sha256).substr(0, 12); }

}  // namespace

Result<Sha256> sha256_from_wire(const std::string& bytes) {
  Sha256 digest{};
  if (bytes.size() != digest.size()) {
    return fail(Errc::kBadValue, fmt::format("a SHA-256 has 32 bytes, not {}", bytes.size()));
  }
  std::copy(bytes.begin(), bytes.end(), digest.begin());
  return digest;
}

std::string sha256_to_wire(const Sha256& digest) { return {digest.begin(), digest.end()}; }

UploadReceiver::UploadReceiver(UploadLimits limits) : limits_(limits) { NODAL_ASSERT(limits_.documents > 0); }

std::list<UploadReceiver::Document>::iterator UploadReceiver::find(const Sha256& sha256) {
  return std::find_if(documents_.begin(), documents_.end(),
                      [&](const Document& document) { return document.sha256 == sha256; });
}

void UploadReceiver::make_room(Owner owner) {
  const auto of = [&](Owner whose) {
    return std::count_if(documents_.begin(), documents_.end(), [&](const Document& d) { return d.owner == whose; });
  };
  // The last match is the one that has not been touched for the longest time.
  const auto drop_last = [&](Owner whose) {
    const auto last =
        std::find_if(documents_.rbegin(), documents_.rend(), [&](const Document& d) { return d.owner == whose; });
    if (last == documents_.rend()) return false;
    documents_.erase(std::next(last).base());
    return true;
  };
  if (owner != kNoOwner && static_cast<std::size_t>(of(owner)) >= limits_.documents_of_owner) drop_last(owner);
  if (documents_.size() < limits_.documents) return;
  if (!drop_last(kNoOwner)) documents_.pop_back();
}

void UploadReceiver::leave(Owner owner) {
  for (Document& document : documents_) {
    if (document.owner == owner) document.owner = kNoOwner;
  }
}

Result<std::uint64_t> UploadReceiver::begin(const Sha256& sha256, std::uint64_t length, Owner owner) {
  if (length > limits_.document_bytes) {
    return fail(Errc::kTooLarge, fmt::format("{} has {} bytes; at most {} are allowed", short_name(sha256), length,
                                             limits_.document_bytes));
  }
  const auto found = find(sha256);
  // Same name, different length: one of them is wrong, and it is unknown which. The newer one is used.
  if (found != documents_.end() && found->length != length) documents_.erase(found);
  if (const auto again = find(sha256); again != documents_.end()) {
    if (again->owner == kNoOwner) again->owner = owner;
    documents_.splice(documents_.begin(), documents_, again);
    return documents_.front().bytes.size();
  }
  make_room(owner);
  documents_.push_front(Document{sha256, length, {}, owner});
  return 0;
}

Status UploadReceiver::write(const Sha256& sha256, std::uint64_t offset, std::span<const std::uint8_t> bytes) {
  const auto found = find(sha256);
  if (found == documents_.end()) {
    return fail(Errc::kNotFound, short_name(sha256) + ": bytes came, but nobody said its length first; begin again");
  }
  documents_.splice(documents_.begin(), documents_, found);
  Document& document = documents_.front();
  const std::uint64_t have = document.bytes.size();
  if (offset > document.length || bytes.size() > document.length - offset) {
    return fail(Errc::kBadValue, fmt::format("{}: {} bytes at {} go past its end at {}", short_name(sha256),
                                             bytes.size(), offset, document.length));
  }
  if (offset > have) {
    return fail(Errc::kBadValue,
                fmt::format("{}: bytes at {}, but only {} are here; begin again to learn where to go on",
                            short_name(sha256), offset, have));
  }
  const std::uint64_t known = std::min<std::uint64_t>(have - offset, bytes.size());
  const auto fresh = bytes.subspan(known);
  document.bytes.insert(document.bytes.end(), fresh.begin(), fresh.end());
  return {};
}

Result<std::vector<std::uint8_t>> UploadReceiver::take(const Sha256& sha256) {
  const auto found = find(sha256);
  if (found == documents_.end()) {
    return fail(Errc::kNotFound, short_name(sha256) + " is not here; begin it first");
  }
  if (found->bytes.size() < found->length) {
    return fail(Errc::kTruncated, fmt::format("{}: {} of {} bytes are here; begin again to go on", short_name(sha256),
                                              found->bytes.size(), found->length));
  }
  std::vector<std::uint8_t> bytes = std::move(found->bytes);
  documents_.erase(found);
  if (const Sha256 actual = nodal::sha256(bytes); actual != sha256) {
    return fail(Errc::kChecksum, short_name(sha256) + ": the bytes that came have SHA-256 " +
                                     to_hex(actual).substr(0, 12) + "; they are thrown away, upload again");
  }
  return bytes;
}

void UploadReceiver::forget(const Sha256& sha256) {
  if (const auto found = find(sha256); found != documents_.end()) documents_.erase(found);
}

Status UploadStream::piece(const BulkPiece& piece, UploadReceiver& receiver) {
  if (piece.first) {
    wire::UploadPart part;
    if (!part.ParseFromString(piece.meta)) {
      return fail(Errc::kBadFormat, "an upload's item does not begin with an UploadPart");
    }
    const auto sha256 = sha256_from_wire(part.sha256());
    if (!sha256) return fail(sha256.error().in("an upload's item"));
    sha256_ = *sha256;
    offset_ = part.offset();
  }
  if (!sha256_) return fail(Errc::kWrongState, "an upload's item goes on that never began");
  if (piece.offset > UINT64_MAX - offset_) {
    return fail(Errc::kBadValue, short_name(*sha256_) + ": an offset beyond all numbers");
  }
  return receiver.write(*sha256_, offset_ + piece.offset, piece.data);
}

UploadSender::UploadSender(SharedBytes document) : document_(std::move(document)) {
  NODAL_ASSERT(document_);
  sha256_ = nodal::sha256(*document_);
}

wire::UploadBegin UploadSender::begin() const {
  wire::UploadBegin begin;
  begin.set_length(document_.size());
  begin.set_sha256(sha256_to_wire(sha256_));
  return begin;
}

Result<BulkItem> UploadSender::item(std::uint64_t offset) const {
  if (offset > document_.size()) {
    return fail(Errc::kProtocol, fmt::format("{}: the rig wants to go on from byte {} of {}", short_name(sha256_),
                                             offset, document_.size()));
  }
  wire::UploadPart part;
  part.set_sha256(sha256_to_wire(sha256_));
  part.set_offset(offset);
  return BulkItem{part.SerializeAsString(), document_, offset};
}

wire::UploadCommit UploadSender::commit() const {
  wire::UploadCommit commit;
  commit.set_sha256(sha256_to_wire(sha256_));
  return commit;
}

}  // namespace nodal
