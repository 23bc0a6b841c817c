#include "protocol/bulk_sender.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "protocol/base/bytes.h"
#include "protocol/base/try.h"

namespace nodal {
namespace {

std::string stream_text(StreamId stream) { return fmt::format("stream {}", stream); }

std::uint64_t whole_body(const BulkItem& item) {
  if (const auto* const bytes = std::get_if<SharedBytes>(&item.body)) return bytes->size();
  const auto& source = std::get<std::shared_ptr<BodySource>>(item.body);
  return source ? source->size() : 0;
}
std::uint64_t body_bytes(const BulkItem& item) { return whole_body(item) - item.offset; }

/// `bytes` bytes of the body from `offset` on: in place, or a copy that was read.
Result<SharedBytes> part_of(const BulkItem& item, std::uint64_t offset, std::size_t bytes) {
  if (const auto* const whole = std::get_if<SharedBytes>(&item.body)) return whole->part(offset, bytes);
  const auto part = std::make_shared<std::vector<std::uint8_t>>(bytes);
  NODAL_TRY(std::get<1>(item.body)->read(offset, *part));
  return SharedBytes(part);
}

}  // namespace

std::uint64_t BulkSender::Pending::total() const { return item.meta.size() + body_bytes(item); }

Result<StreamId> BulkSender::open(StreamPolicy policy) {
  if (streams_.size() >= kMaxStreams) {
    return fail(Errc::kOverload, fmt::format("{} streams are open already; close one first", kMaxStreams));
  }
  const StreamId id = next_id_;
  next_id_ += 2;
  streams_[id].policy = policy;
  return id;
}

Status BulkSender::offer(StreamId id, BulkItem item) {
  const auto found = streams_.find(id);
  if (found == streams_.end() || found->second.closing) {
    return fail(Errc::kWrongState, stream_text(id) + " is closed; nothing can be offered to it");
  }
  if (item.offset > whole_body(item)) {
    return fail(Errc::kBadValue, stream_text(id) + ": an item that begins after its own end");
  }
  if (item.meta.size() > kMaxMetaBytes || body_bytes(item) > kMaxItemBytes - item.meta.size()) {
    return fail(Errc::kTooLarge, fmt::format("{}: an item's meta of {} bytes or its body of {} bytes is over the limit",
                                             stream_text(id), item.meta.size(), body_bytes(item)));
  }
  Stream& stream = found->second;
  if (stream.policy == StreamPolicy::kLossless && stream.queue.size() >= kLosslessQueueItems) {
    return fail(Errc::kOverload, fmt::format("{} has {} items waiting; offer again when counts() shows fewer",
                                             stream_text(id), kLosslessQueueItems));
  }
  const bool replaces = stream.policy == StreamPolicy::kLatest && !stream.queue.empty() && !stream.queue.back().begun;
  if (replaces) {
    stream.queue.pop_back();
    ++stream.counts.dropped;
  }
  stream.queue.push_back(Pending{stream.counts.offered, std::move(item), 0, false});
  ++stream.counts.offered;
  return {};
}

void BulkSender::close(StreamId id, std::optional<Error> error) {
  const auto found = streams_.find(id);
  if (found == streams_.end()) return;
  Stream& stream = found->second;
  stream.closing = true;
  if (!error) return;
  if (!stream.queue.empty() && stream.queue.front().all_sent()) {  // its last piece is on the link, and arrives
    stream.queue.pop_front();
    ++stream.counts.delivered;
  }
  stream.counts.dropped += stream.queue.size();
  stream.queue.clear();
  stream.error = std::move(error);
}

std::optional<StreamCounts> BulkSender::counts(StreamId id) const {
  const auto found = streams_.find(id);
  if (found == streams_.end()) return std::nullopt;
  StreamCounts counts = found->second.counts;
  counts.pending = found->second.queue.size();
  return counts;
}

Status BulkSender::credit(StreamId id, std::uint64_t allowed) {
  const auto found = streams_.find(id);
  if (found == streams_.end()) {
    const bool was_ours = id < next_id_ && id % 2 == next_id_ % 2;
    if (was_ours) return {};
    return fail(Errc::kProtocol, "a credit for " + stream_text(id) + ", which this end never opened");
  }
  if (allowed < found->second.allowed) {
    return fail(Errc::kProtocol, fmt::format("{}: a credit was taken back, from {} to {}", stream_text(id),
                                             found->second.allowed, allowed));
  }
  found->second.allowed = allowed;
  return {};
}

bool BulkSender::stop(StreamId id, const Error& why) {
  if (!streams_.contains(id)) return false;
  close(id, why);
  return true;
}

Result<BulkSender::Piece> BulkSender::cut(StreamId id, Stream& stream) {
  Pending& pending = stream.queue.front();
  const std::uint64_t total = pending.total();
  const std::uint64_t credit = stream.allowed - stream.sent;
  const std::uint64_t n = std::min({std::uint64_t{kMaxPieceBytes}, total - pending.sent, credit});
  const std::size_t meta = pending.item.meta.size();
  const std::size_t meta_now = pending.begun ? 0 : meta;

  Piece piece;
  piece.stream = id;
  piece.head.resize(kPieceHeaderBytes + meta_now);
  ByteWriter out(piece.head);
  out.u64(pending.number);
  out.u64(total);
  out.u64(pending.sent);
  out.u32(static_cast<std::uint32_t>(meta));
  if (meta_now > 0) out.bytes({reinterpret_cast<const std::uint8_t*>(pending.item.meta.data()), meta_now});
  NODAL_ASSERT(out.ok());
  if (n > meta_now) {
    const std::uint64_t from = pending.item.offset + pending.sent + meta_now - meta;
    auto part = part_of(pending.item, from, n - meta_now);
    if (!part) return fail(std::move(part).error());
    piece.slice = *std::move(part);
  }

  pending.begun = true;
  pending.sent += n;
  stream.sent += n;
  on_link_ = OnLink{id};
  return piece;
}

void BulkSender::taken(std::uint64_t bytes, bool whole) {
  NODAL_ASSERT(on_link_ && bytes >= on_link_->taken);
  const std::uint64_t more = bytes - std::exchange(on_link_->taken, bytes);
  taken_bytes_ += more;
  const auto found = streams_.find(on_link_->stream);
  if (found != streams_.end()) {
    Stream& stream = found->second;
    stream.counts.bytes += more;
    if (whole && !stream.queue.empty() && stream.queue.front().all_sent()) {
      stream.queue.pop_front();
      ++stream.counts.delivered;
    }
  }
  if (whole) on_link_.reset();
}

std::optional<BulkSender::Piece> BulkSender::next_piece() {
  NODAL_ASSERT(!on_link_);
  const auto may_go = [](const Stream& stream) {
    if (stream.queue.empty()) return false;
    const Pending& pending = stream.queue.front();
    const std::uint64_t credit = stream.allowed - stream.sent;
    if (pending.begun) return credit > 0;
    return credit >= std::max<std::uint64_t>(pending.item.meta.size(), pending.total() > 0 ? 1 : 0);
  };
  // Round robin, starting with the stream after the one served last.
  auto candidate = streams_.upper_bound(last_served_);
  for (std::size_t i = 0; i < streams_.size(); ++i, ++candidate) {
    if (candidate == streams_.end()) candidate = streams_.begin();
    if (!may_go(candidate->second)) continue;
    last_served_ = candidate->first;
    auto piece = cut(candidate->first, candidate->second);
    if (piece) return *std::move(piece);
    close(candidate->first, std::move(piece).error());
  }
  return std::nullopt;
}

std::optional<BulkSender::Closed> BulkSender::next_closed() {
  for (auto it = streams_.begin(); it != streams_.end(); ++it) {
    if (!it->second.closing || !it->second.queue.empty()) continue;
    Closed closed{it->first, it->second.counts, std::move(it->second.error)};
    streams_.erase(it);
    return closed;
  }
  return std::nullopt;
}

}  // namespace nodal
