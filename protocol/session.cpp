#include "protocol/session.h"

#include <algorithm>
#include <utility>

#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "protocol/known_fields.h"
#include "protocol/reply_size.h"
#include "protocol/silence_protobuf.h"

namespace nodal {
namespace {

// Control frames are written together up to this size: few writes, and a short wait for later frames.
constexpr std::size_t kFrontBytes = 64U << 10;

constexpr std::size_t kLongestMessage = 1000;

wire::Error to_wire(const Error& error) {
  wire::Error message;
  message.set_code(static_cast<std::uint32_t>(error.code));
  message.set_message(printable(error.message, kLongestMessage));
  return message;
}

Error from_wire(const wire::Error& message) {
  const std::uint32_t code = std::min<std::uint32_t>(message.code(), UINT16_MAX);
  return Error{static_cast<Errc>(code), printable(message.message(), kLongestMessage)};
}

template <class Message>
Result<Message> parse(const WireFrame& frame) {
  Message message;
  if (!message.ParseFromArray(frame.payload.data(), static_cast<int>(frame.payload.size()))) {
    return fail(Errc::kProtocol,
                "what a " + std::string(frame_type_name(frame.header.type)) + " frame holds cannot be read as one");
  }
  return message;
}

bool is_stream_frame(FrameType type) { return type >= FrameType::kStreamOpen; }

std::string range(std::uint32_t low, std::uint32_t high) {
  return low == high ? std::to_string(low) : std::to_string(low) + " to " + std::to_string(high);
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
      sender_(role == Role::kHost ? 1 : 2) {
  silence_protobuf();
  NODAL_ASSERT(mine_.ByteSizeLong() <= kMaxMessageBytes);
  push_control(FrameType::kHello, 0, mine_.SerializeAsString());
}

std::string Session::peer_name() const {
  const std::string who = role_ == Role::kHost ? "the rig" : "the host";
  if (!peer_hello_) return who;
  return who + " (" + printable(peer_hello_->software(), 60) + ")";
}

tl::unexpected<Error> Session::die(Error error, bool tell_peer) {
  NODAL_ASSERT(!dead_);
  if (tell_peer) push_control(FrameType::kBye, 0, to_wire(error).SerializeAsString());
  dead_ = std::move(error);
  sender_ = BulkSender(0);  // releases all bodies
  front_item_.reset();      // its item belonged to a stream of the old sender_
  return fail(*dead_);
}

void Session::close(const Error& why) {
  if (!dead_) die(why, true);
}

void Session::ping() { ping_due_ = version_ >= kProtocolPing; }

// --- bytes in ----------------------------------------------------------------------------------------

bool Session::wants_input() const {
  const std::size_t most = role_ == Role::kRig ? kMaxRigEventQueueBytes : kMaxEventQueueBytes;
  return !dead_ && event_bytes_ < most && control_bytes_ < most_control_bytes();
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
    return fail(Errc::kProtocol,
                "a " + std::string(frame_type_name(type)) + " frame on stream " + std::to_string(frame.header.stream));
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
    case FrameType::kPing: pong_due_ = true; return {};
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
    return fail(Errc::kProtocol, "a hello that speaks protocol " + std::to_string(hello.protocol_min()) + " to " +
                                     std::to_string(hello.protocol_max()) + ", which is no range");
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
  if (sender_.stop(frame.header.stream, why)) {
    push_event(StreamStopped{frame.header.stream, std::move(why)}, frame.payload.size());
  }
  return {};
}

Status Session::handle_credit(const WireFrame& frame) {
  NODAL_TRY_ASSIGN(const auto credit, parse<wire::StreamCredit>(frame));
  return sender_.credit(frame.header.stream, credit.allowed());
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

// --- bytes out ---------------------------------------------------------------------------------------

void Session::append_control(FrameType type, StreamId stream, const std::string& payload) {
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size());
  const auto header = encode_frame_header(FrameHeader{type, 0, stream, sequence_++}, bytes);
  front_.insert(front_.end(), header.begin(), header.end());
  front_.insert(front_.end(), bytes.begin(), bytes.end());
}

void Session::next_front() {
  front_.clear();
  front_slice_ = {};
  front_sent_ = 0;
  front_item_.reset();
  while (!control_.empty() && front_.size() < kFrontBytes) {
    const QueuedFrame& frame = control_.front();
    append_control(frame.type, frame.stream, frame.payload);
    control_bytes_ -= frame.payload.size() + kFrameHeaderBytes;
    control_.pop_front();
  }
  if (dead_ || front_.size() >= kFrontBytes) return;
  if (std::exchange(ping_due_, false)) append_control(FrameType::kPing, 0, {});
  if (std::exchange(pong_due_, false)) append_control(FrameType::kPong, 0, {});
  // Closes and credits are created when they are written, so that they need no memory while they wait.
  while (const auto credit = receiver_.next_credit()) {
    wire::StreamCredit message;
    message.set_allowed(credit->allowed);
    append_control(FrameType::kCredit, credit->stream, message.SerializeAsString());
  }
  append_closes();
  if (!front_.empty()) return;
  if (auto piece = sender_.next_piece()) {
    const auto header =
        encode_frame_header(FrameHeader{FrameType::kBulk, 0, piece->stream, sequence_++}, piece->head, *piece->slice);
    front_.insert(front_.end(), header.begin(), header.end());
    front_.insert(front_.end(), piece->head.begin(), piece->head.end());
    front_slice_ = std::move(piece->slice);
    front_item_ = kFrameHeaderBytes + kPieceHeaderBytes;
  } else {
    append_closes();  // next_piece() gives up streams whose bodies it cannot read
  }
}

void Session::append_closes() {
  while (const auto closed = sender_.next_closed()) {
    wire::StreamClose message;
    message.set_offered(closed->counts.offered);
    message.set_dropped(closed->counts.dropped);
    if (closed->error) *message.mutable_error() = to_wire(*closed->error);
    append_control(FrameType::kStreamClose, closed->stream, message.SerializeAsString());
  }
}

std::span<const std::uint8_t> Session::output() {
  if (front_sent_ == front_.size() + front_slice_.size()) next_front();
  if (front_sent_ < front_.size()) return std::span<const std::uint8_t>(front_).subspan(front_sent_);
  return (*front_slice_).subspan(front_sent_ - front_.size());
}

void Session::sent(std::size_t bytes) {
  NODAL_ASSERT(bytes <= front_.size() + front_slice_.size() - front_sent_);
  front_sent_ += bytes;
  if (!front_item_) return;
  const bool whole = front_sent_ == front_.size() + front_slice_.size();
  sender_.taken(front_sent_ - std::min(front_sent_, *front_item_), whole);
}

void Session::push_control(FrameType type, StreamId stream, std::string payload) {
  control_.push_back(QueuedFrame{type, stream, std::move(payload)});
  control_bytes_ += control_.back().payload.size() + kFrameHeaderBytes;
}

Status Session::send_message(FrameType type, const google::protobuf::MessageLite& message) {
  if (dead_) return fail(*dead_);
  const std::size_t bytes = message.ByteSizeLong();
  if (const std::size_t limit = max_payload_bytes(type); bytes > limit) {
    return fail(Errc::kTooLarge, "a " + std::string(frame_type_name(type)) + " of " + std::to_string(bytes) +
                                     " bytes; at most " + std::to_string(limit) + " can be sent");
  }
  if (control_bytes_ + bytes > most_control_bytes()) {
    return fail(Errc::kOverload,
                peer_name() + " does not read: " + std::to_string(control_bytes_) + " bytes of messages wait for it");
  }
  // The peer ends the session at a message that it cannot parse, so such a message is refused here.
  std::string payload = message.SerializeAsString();
  if (!std::unique_ptr<google::protobuf::MessageLite>(message.New())->ParseFromString(payload)) {
    return fail(Errc::kBadValue, "a text in a " + std::string(frame_type_name(type)) + " is not UTF-8");
  }
  push_control(type, 0, std::move(payload));
  return {};
}

Status Session::send(const wire::Request& request) {
  NODAL_ASSERT(role_ == Role::kHost);
  return send_message(FrameType::kRequest, request);
}

Status Session::send(const wire::Reply& reply) {
  NODAL_ASSERT(role_ == Role::kRig);
  if (!reply.has_error()) return send_message(FrameType::kReply, reply);
  // Error messages contain names of files and devices, which may be any bytes.
  wire::Reply clean = reply;
  clean.mutable_error()->set_message(printable(reply.error().message(), kLongestMessage));
  return send_message(FrameType::kReply, clean);
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
  push_control(FrameType::kStreamStop, stream, message.SerializeAsString());
}

}  // namespace nodal
