#include "protocol/outgoing_frames.h"

#include <algorithm>
#include <utility>

#include "protocol/nodal.pb.h"
#include "protocol/wire_error.h"

namespace nodal {
namespace {

// Control frames are written together up to this size: few writes, and a short wait for later frames.
constexpr std::size_t kFrontBytes = 64U << 10;

}  // namespace

void OutgoingFrames::push(FrameType type, StreamId stream, std::string payload) {
  queue_.push_back(Queued{type, stream, std::move(payload)});
  queued_bytes_ += queue_.back().payload.size() + kFrameHeaderBytes;
}

void OutgoingFrames::end_streams() {
  ended_ = true;
  streams_ = BulkSender(0);
  front_item_.reset();  // its item belonged to a stream that is gone
}

std::span<const std::uint8_t> OutgoingFrames::output(BulkReceiver& received) {
  if (front_sent_ == front_bytes()) next_front(received);
  if (front_sent_ < front_.size()) return std::span<const std::uint8_t>(front_).subspan(front_sent_);
  return (*front_slice_).subspan(front_sent_ - front_.size());
}

void OutgoingFrames::sent(std::size_t bytes) {
  NODAL_ASSERT(bytes <= front_bytes() - front_sent_);
  front_sent_ += bytes;
  if (!front_item_) return;
  streams_.taken(front_sent_ - std::min(front_sent_, *front_item_), front_sent_ == front_bytes());
}

void OutgoingFrames::next_front(BulkReceiver& received) {
  front_.clear();
  front_slice_ = {};
  front_sent_ = 0;
  front_item_.reset();
  while (!queue_.empty() && front_.size() < kFrontBytes) {
    const Queued& frame = queue_.front();
    append(frame.type, frame.stream, frame.payload);
    queued_bytes_ -= frame.payload.size() + kFrameHeaderBytes;
    queue_.pop_front();
  }
  if (ended_ || front_.size() >= kFrontBytes) return;
  if (std::exchange(ping_due_, false)) append(FrameType::kPing, 0, {});
  if (std::exchange(pong_due_, false)) append(FrameType::kPong, 0, {});
  // Closes and credits are created when they are written, so that they need no memory while they wait.
  while (const auto credit = received.next_credit()) {
    wire::StreamCredit message;
    message.set_allowed(credit->allowed);
    append(FrameType::kCredit, credit->stream, message.SerializeAsString());
  }
  append_closes();
  if (!front_.empty()) return;
  if (auto piece = streams_.next_piece()) append_piece(std::move(*piece));
  else append_closes();  // next_piece() gives up streams whose bodies it cannot read
}

void OutgoingFrames::append(FrameType type, StreamId stream, const std::string& payload) {
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size());
  const auto header = encode_frame_header(FrameHeader{type, 0, stream, sequence_++}, bytes);
  front_.insert(front_.end(), header.begin(), header.end());
  front_.insert(front_.end(), bytes.begin(), bytes.end());
}

void OutgoingFrames::append_closes() {
  while (const auto closed = streams_.next_closed()) {
    wire::StreamClose message;
    message.set_offered(closed->counts.offered);
    message.set_dropped(closed->counts.dropped);
    if (closed->error) *message.mutable_error() = to_wire(*closed->error);
    append(FrameType::kStreamClose, closed->stream, message.SerializeAsString());
  }
}

void OutgoingFrames::append_piece(BulkSender::Piece piece) {
  const auto header =
      encode_frame_header(FrameHeader{FrameType::kBulk, 0, piece.stream, sequence_++}, piece.head, *piece.slice);
  front_.insert(front_.end(), header.begin(), header.end());
  front_.insert(front_.end(), piece.head.begin(), piece.head.end());
  front_slice_ = std::move(piece.slice);
  front_item_ = kFrameHeaderBytes + kPieceHeaderBytes;
}

}  // namespace nodal
