#include "protocol/session.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "protocol/known_fields.h"
#include "protocol/reply_size.h"
#include "protocol/silence_protobuf.h"
#include "protocol/wire_error.h"

namespace nodal {
namespace {

template <class Message>
Result<Message> parse(const WireFrame& frame) {
  Message message;
  if (!message.ParseFromArray(frame.payload.data(), static_cast<int>(frame.payload.size()))) {
    return fail(Errc::kProtocol,
                "what a " + std::string(frame_type_name(frame.header.type)) + " frame holds cannot be read as one");
  }
  return message;
}

std::size_t max_queued_bytes(Role role) {
  return role == Role::kRig ? kMaxRigControlQueueBytes : kMaxControlQueueBytes;
}

bool is_stream_frame(FrameType type) { return type >= FrameType::kStreamOpen; }

std::string range(std::uint32_t low, std::uint32_t high) {
  return low == high ? std::to_string(low) : fmt::format("{} to {}", low, high);
}

}  // namespace

wire::Hello make_hello(std::string software) {
  wire::Hello hello;
  hello.set_protocol_min(kProtocolMin);
  hello.set_protocol_max(kProtocolMax);
  hello.set_software(std::move(software));
  return hello;
}

// A host's streams have odd numbers, a rig's even ones.
Session::Session(Role role, const wire::Hello& mine)
    : role_(role),
      mine_(mine),
      decoder_(role == Role::kHost ? kMaxReplyBytes : kMaxRequestBytes),
      receiver_(role == Role::kHost ? 2 : 1, role == Role::kHost ? kHostLosslessWindowBytes : kStreamWindowBytes),
      outgoing_(role == Role::kHost ? 1 : 2) {
  silence_protobuf();
  NODAL_ASSERT(mine_.ByteSizeLong() <= kMaxMessageBytes);
  outgoing_.push(FrameType::kHello, 0, mine_.SerializeAsString());
}

std::string Session::peer_name() const {
  const std::string who = role_ == Role::kHost ? "the rig" : "the host";
  if (!peer_hello_) return who;
  return who + " (" + printable(peer_hello_->software(), 60) + ")";
}

tl::unexpected<Error> Session::die(Error error, bool tell_peer) {
  NODAL_ASSERT(!dead_);
  if (tell_peer) outgoing_.push(FrameType::kBye, 0, to_wire(error).SerializeAsString());
  dead_ = std::move(error);
  outgoing_.end_streams();
  return fail(*dead_);
}

void Session::close(const Error& why) {
  if (!dead_) die(why, true);
}

void Session::ping() {
  if (version_ >= kProtocolPing) outgoing_.ping();
}

// --- bytes in ----------------------------------------------------------------------------------------

bool Session::wants_input() const {
  const std::size_t most = role_ == Role::kRig ? kMaxRigEventQueueBytes : kMaxEventQueueBytes;
  return !dead_ && event_bytes_ < most && outgoing_.queued_bytes() < max_queued_bytes(role_);
}

Status Session::receive(std::span<const std::uint8_t> bytes) {
  if (dead_) return fail(*dead_);
  if (!wants_input()) {
    return fail(Errc::kOverload, "bytes were given to a session that has too many events or replies waiting");
  }
  while (true) {
    const auto frame = decoder_.next(bytes);
    if (!frame) return die(frame.error().in("from " + peer_name()), true);
    if (!*frame) return {};
    if (Status good = handle(**frame); !good) {
      if (!dead_) return die(good.error().in("from " + peer_name()), true);
      return good;
    }
  }
}

Status Session::handle(const WireFrame& frame) {
  const FrameType type = frame.header.type;
  if (is_stream_frame(type) != (frame.header.stream != 0)) {
    return fail(Errc::kProtocol, fmt::format("a {} frame on stream {}", frame_type_name(type), frame.header.stream));
  }
  // A Bye may come first: an end without room for another client refuses it that way.
  if ((type == FrameType::kHello) == (peer_hello_ != std::nullopt) && type != FrameType::kBye) {
    return fail(Errc::kProtocol, peer_hello_ ? "a second hello" : "the first frame is not a hello");
  }
  if (type == (role_ == Role::kHost ? FrameType::kRequest : FrameType::kReply)) {
    return fail(Errc::kProtocol,
                role_ == Role::kHost ? "a request, which only hosts make" : "a reply, which only rigs give");
  }
  switch (type) {
    case FrameType::kHello: return handle_hello(frame);
    case FrameType::kBye: return handle_bye(frame);
    case FrameType::kPing: outgoing_.answer_ping(); return {};
    case FrameType::kPong: return {};
    case FrameType::kStreamOpen: return handle_stream_open(frame);
    case FrameType::kStreamClose: return handle_stream_close(frame);
    case FrameType::kStreamStop: return handle_stream_stop(frame);
    case FrameType::kCredit: return handle_credit(frame);
    case FrameType::kBulk: return handle_bulk(frame);
    case FrameType::kTakeRecord: break;
    case FrameType::kRequest: {
      NODAL_TRY_ASSIGN(auto request, parse<wire::Request>(frame));
      drop_unknown_fields(request);
      push_event(std::move(request), frame.payload.size());
      return {};
    }
    case FrameType::kReply: {
      NODAL_TRY(check_reply_size(frame.payload));
      NODAL_TRY_ASSIGN(auto reply, parse<wire::Reply>(frame));
      push_event(std::move(reply), frame.payload.size());
      return {};
    }
  }
  return fail(Errc::kProtocol, "a frame of a type this end does not know");
}

Status Session::handle_hello(const WireFrame& frame) {
  NODAL_TRY_ASSIGN(auto hello, parse<wire::Hello>(frame));
  if (hello.protocol_min() == 0 || hello.protocol_min() > hello.protocol_max()) {
    return fail(Errc::kProtocol, fmt::format("a hello that speaks protocol {} to {}, which is no range",
                                             hello.protocol_min(), hello.protocol_max()));
  }
  if (hello.features_size() > kMaxFeatures) {
    wire::Hello kept = hello;
    kept.mutable_features()->DeleteSubrange(kMaxFeatures, kept.features_size() - kMaxFeatures);
    hello = wire::Hello(kept);  // a copy, because what was deleted is kept for reuse
  }
  peer_hello_ = std::move(hello);
  const bool mine_is_old = mine_.protocol_max() < peer_hello_->protocol_min();
  const bool peer_is_old = peer_hello_->protocol_max() < mine_.protocol_min();
  if (mine_is_old || peer_is_old) {
    const std::string me = std::string(role_ == Role::kHost ? "this host" : "this rig") + " (" + mine_.software() + ")";
    return die(Error{Errc::kVersionMismatch,
                     me + " speaks protocol " + range(mine_.protocol_min(), mine_.protocol_max()) + ", " + peer_name() +
                         " speaks " + range(peer_hello_->protocol_min(), peer_hello_->protocol_max()) + ": " +
                         (mine_is_old ? me : peer_name()) + " is too old, update it"},
               true);
  }
  version_ = std::min(mine_.protocol_max(), peer_hello_->protocol_max());
  push_event(*peer_hello_, frame.payload.size());
  return {};
}

Status Session::handle_bye(const WireFrame& frame) {
  NODAL_TRY_ASSIGN(const auto bye, parse<wire::Error>(frame));
  return die(from_wire(bye).in(peer_name() + " ended the session"), false);
}

Status Session::handle_stream_open(const WireFrame& frame) {
  NODAL_TRY_ASSIGN(const auto open, parse<wire::StreamOpen>(frame));
  NODAL_TRY(receiver_.open(frame.header.stream, open.policy()));
  push_event(StreamOpened{frame.header.stream, static_cast<StreamPolicy>(open.policy())}, frame.payload.size());
  return {};
}

Status Session::handle_stream_close(const WireFrame& frame) {
  NODAL_TRY_ASSIGN(const auto close, parse<wire::StreamClose>(frame));
  NODAL_TRY_ASSIGN(const auto known,
                   receiver_.close(frame.header.stream, close.offered(), close.dropped(), close.has_error()));
  if (!known) return {};
  StreamClosed closed{frame.header.stream, close.offered(), close.dropped(), std::nullopt};
  if (close.has_error()) closed.error = from_wire(close.error());
  push_event(std::move(closed), frame.payload.size());
  return {};
}

Status Session::handle_stream_stop(const WireFrame& frame) {
  NODAL_TRY_ASSIGN(const auto stop, parse<wire::StreamStop>(frame));
  Error why = from_wire(stop.why());
  // A stop for a closed stream is no error: it was sent before our close arrived.
  if (outgoing_.streams().stop(frame.header.stream, why)) {
    push_event(StreamStopped{frame.header.stream, std::move(why)}, frame.payload.size());
  }
  return {};
}

Status Session::handle_credit(const WireFrame& frame) {
  NODAL_TRY_ASSIGN(const auto credit, parse<wire::StreamCredit>(frame));
  return outgoing_.streams().credit(frame.header.stream, credit.allowed());
}

Status Session::handle_bulk(const WireFrame& frame) {
  NODAL_TRY_ASSIGN(auto piece, receiver_.piece(frame.header.stream, frame.payload));
  if (piece) push_event(std::move(*piece), frame.payload.size());
  return {};
}

void Session::push_event(Event event, std::size_t bytes) {
  bytes += sizeof(QueuedEvent);
  event_bytes_ += bytes;
  events_.push_back(QueuedEvent{std::move(event), bytes});
}

std::optional<Event> Session::next_event() {
  if (events_.empty()) return std::nullopt;
  std::optional<Event> event(std::move(events_.front().event));
  event_bytes_ -= events_.front().bytes;
  events_.pop_front();
  if (const auto* piece = std::get_if<BulkPiece>(&*event)) receiver_.consumed(*piece);
  return event;
}

Status Session::end_of_input() const {
  if (dead_) return fail(*dead_);
  if (!decoder_.at_border()) {
    return fail(Errc::kLinkClosed, "the link to " + peer_name() + " went down in the middle of a frame");
  }
  if (receiver_.inside_item()) {
    return fail(Errc::kLinkClosed, "the link to " + peer_name() + " went down in the middle of an item");
  }
  return {};
}

// --- what to say --------------------------------------------------------------------------------------

Status Session::send_message(FrameType type, const google::protobuf::MessageLite& message) {
  if (dead_) return fail(*dead_);
  const std::size_t bytes = message.ByteSizeLong();
  if (const std::size_t limit = max_payload_bytes(type); bytes > limit) {
    return fail(Errc::kTooLarge,
                fmt::format("a {} of {} bytes; at most {} can be sent", frame_type_name(type), bytes, limit));
  }
  if (outgoing_.queued_bytes() + bytes > max_queued_bytes(role_)) {
    return fail(Errc::kOverload, fmt::format("{} does not read: {} bytes of messages wait for it", peer_name(),
                                             outgoing_.queued_bytes()));
  }
  // The peer ends the session at a message that it cannot parse, so such a message is refused here.
  std::string payload = message.SerializeAsString();
  if (!std::unique_ptr<google::protobuf::MessageLite>(message.New())->ParseFromString(payload)) {
    return fail(Errc::kBadValue, "a text in a " + std::string(frame_type_name(type)) + " is not UTF-8");
  }
  outgoing_.push(type, 0, std::move(payload));
  return {};
}

Status Session::send(const wire::Request& request) {
  NODAL_ASSERT(role_ == Role::kHost);
  return send_message(FrameType::kRequest, request);
}

Status Session::send(const wire::Reply& reply) {
  NODAL_ASSERT(role_ == Role::kRig);
  if (!reply.has_error()) return send_message(FrameType::kReply, reply);
  wire::Reply clean = reply;
  *clean.mutable_error() = to_wire(from_wire(reply.error()));
  return send_message(FrameType::kReply, clean);
}

// --- bulk --------------------------------------------------------------------------------------------

Result<StreamId> Session::open_stream(StreamPolicy policy) {
  if (dead_) return fail(*dead_);
  NODAL_TRY_ASSIGN(const auto stream, outgoing_.streams().open(policy));
  wire::StreamOpen message;
  message.set_policy(static_cast<std::uint32_t>(policy));
  outgoing_.push(FrameType::kStreamOpen, stream, message.SerializeAsString());
  return stream;
}

Status Session::offer(StreamId stream, BulkItem item) {
  if (dead_) return fail(*dead_);
  return outgoing_.streams().offer(stream, std::move(item));
}

void Session::close_stream(StreamId stream, std::optional<Error> error) {
  if (!dead_) outgoing_.streams().close(stream, std::move(error));
}

std::optional<StreamCounts> Session::counts(StreamId stream) const { return outgoing_.streams().counts(stream); }

std::uint64_t Session::under_way_of(std::optional<StreamId> stream) const {
  const FrameHeader* const header = decoder_.header_under_way();
  if (!header || header->type != FrameType::kBulk || header->stream != stream.value_or(header->stream)) return 0;
  return decoder_.under_way() - std::min(decoder_.under_way(), kFrameHeaderBytes + kPieceHeaderBytes);
}

void Session::stop_stream(StreamId stream, const Error& why) {
  if (dead_ || !receiver_.stop(stream)) return;
  std::erase_if(events_, [&](const QueuedEvent& queued) {
    const auto* piece = std::get_if<BulkPiece>(&queued.event);
    const bool of_stream = piece != nullptr && piece->stream == stream;
    if (of_stream) event_bytes_ -= queued.bytes;
    return of_stream;
  });
  wire::StreamStop message;
  *message.mutable_why() = to_wire(why);
  outgoing_.push(FrameType::kStreamStop, stream, message.SerializeAsString());
}

}  // namespace nodal
