#include "protocol/bulk_receiver.h"

#include <fmt/format.h>

#include "protocol/base/bytes.h"

namespace nodal {
namespace {

std::string name(StreamId stream) { return fmt::format("stream {}", stream); }

tl::unexpected<Error> broken(StreamId stream, std::string how) {
  return fail(Errc::kProtocol, name(stream) + ": " + std::move(how));
}

}  // namespace

Status BulkReceiver::open(StreamId id, std::uint32_t policy) {
  if (id != next_id_) return broken(id, "was opened out of turn; " + name(next_id_) + " is next");
  if (policy != static_cast<std::uint32_t>(StreamPolicy::kLossless) &&
      policy != static_cast<std::uint32_t>(StreamPolicy::kLatest)) {
    return broken(id, fmt::format("was opened with policy {}, which is neither lossless nor latest", policy));
  }
  if (streams_.size() >= kMaxStreams) {
    return broken(id, fmt::format("was opened while {} others were, which is the limit", kMaxStreams));
  }
  next_id_ += 2;
  Stream& stream = streams_[id];
  stream.policy = static_cast<StreamPolicy>(policy);
  stream.window = stream.policy == StreamPolicy::kLossless ? lossless_window_ : kStreamWindowBytes;
  return {};
}

// Checks a piece's header against the pieces before it on its stream.
Status BulkReceiver::check_order(const Stream& stream, const PieceHeader& header, std::size_t bytes) {
  const auto wrong = [](std::string how) { return fail(Errc::kProtocol, std::move(how)); };
  if (header.total > kMaxItemBytes || header.meta > kMaxMetaBytes || header.meta > header.total) {
    return wrong(fmt::format("an item of {} bytes with a meta of {} is over the limits", header.total, header.meta));
  }
  if (header.offset != stream.next_offset) {
    return wrong(fmt::format("a piece at byte {} came where byte {} was due", header.offset, stream.next_offset));
  }
  if (header.offset > 0) {
    if (header.item != stream.item || header.total != stream.total || header.meta != stream.meta) {
      return wrong("an item changed its number or size between two pieces");
    }
  } else if (header.item < stream.next_item ||
             (stream.policy == StreamPolicy::kLossless && header.item != stream.next_item)) {
    return wrong(fmt::format("item {} came where item {} was due", header.item, stream.next_item));
  }
  if (bytes > header.total - header.offset) return wrong("a piece goes past its item's end");
  if (bytes == 0 && header.total > 0) return wrong("a piece without bytes");
  if (header.offset == 0 && bytes < header.meta) return wrong("an item's meta was cut in two");
  // Compared with the granted room, whether the credit has been sent or not: an error must not depend on its timing.
  if (bytes > stream.consumed + stream.window - stream.received) {
    return wrong("more bytes came than there was credit for");
  }
  return {};
}

Result<std::optional<BulkPiece>> BulkReceiver::piece(StreamId id, std::span<const std::uint8_t> payload) {
  const auto found = streams_.find(id);
  if (found == streams_.end()) return broken(id, "a piece came, but the stream is not open");
  Stream& stream = found->second;

  ByteReader in(payload);
  const PieceHeader header{in.u64(), in.u64(), in.u64(), in.u32()};
  if (!in.ok()) return broken(id, "a piece is shorter than its header");
  const auto bytes = in.rest();
  if (Status good = check_order(stream, header, bytes.size()); !good) return fail(good.error().in(name(id)));

  const bool first = header.offset == 0;
  const bool last = header.offset + bytes.size() == header.total;
  stream.received += bytes.size();
  received_bytes_ += bytes.size();
  stream.item = header.item;
  stream.total = header.total;
  stream.meta = header.meta;
  stream.next_offset = last ? 0 : header.offset + bytes.size();
  const std::uint64_t dropped = header.item - stream.whole;
  if (last) {
    stream.next_item = header.item + 1;
    ++stream.whole;
  }
  if (stream.stopped) return std::nullopt;

  BulkPiece piece;
  piece.stream = id;
  piece.item = header.item;
  piece.dropped = dropped;
  const auto meta = bytes.first(first ? header.meta : 0);
  piece.meta.assign(meta.begin(), meta.end());
  const auto data = bytes.subspan(meta.size());
  piece.data.assign(data.begin(), data.end());
  piece.offset = first ? 0 : header.offset - header.meta;
  piece.total = header.total - header.meta;
  piece.first = first;
  piece.last = last;
  return piece;
}

Result<bool> BulkReceiver::close(StreamId id, std::uint64_t offered, std::uint64_t dropped, bool torn) {
  const auto found = streams_.find(id);
  if (found == streams_.end()) return broken(id, "was closed, but is not open");
  const Stream stream = found->second;
  streams_.erase(found);
  if (stream.next_offset != 0 && !torn) return broken(id, "was closed in the middle of an item");
  if (offered < stream.whole || dropped != offered - stream.whole) {
    return broken(
        id, fmt::format("says {} items were offered and {} dropped, but {} came", offered, dropped, stream.whole));
  }
  if (stream.policy == StreamPolicy::kLossless && dropped > 0 && !torn) {
    return broken(id, fmt::format("is lossless, but lost {} items", dropped));
  }
  return !stream.stopped;
}

bool BulkReceiver::stop(StreamId id) {
  const auto found = streams_.find(id);
  if (found == streams_.end() || found->second.stopped) return false;
  found->second.stopped = true;
  return true;
}

void BulkReceiver::consumed(const BulkPiece& piece) {
  const auto found = streams_.find(piece.stream);
  if (found != streams_.end()) found->second.consumed += piece.meta.size() + piece.data.size();
}

std::optional<BulkReceiver::Credit> BulkReceiver::next_credit() {
  for (auto& [id, stream] : streams_) {
    const std::uint64_t allowed = stream.consumed + stream.window;
    if (stream.stopped || allowed - stream.credit_sent < stream.window / 4) continue;
    stream.credit_sent = allowed;
    return Credit{id, allowed};
  }
  return std::nullopt;
}

std::uint64_t BulkReceiver::received_bytes(StreamId id) const {
  const auto found = streams_.find(id);
  return found == streams_.end() ? 0 : found->second.received;
}

bool BulkReceiver::inside_item() const {
  for (const auto& [id, stream] : streams_) {
    if (stream.next_offset != 0 && !stream.stopped) return true;
  }
  return false;
}

}  // namespace nodal
