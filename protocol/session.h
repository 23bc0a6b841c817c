// One end of a conversation, without the link: bytes go in; events and bytes come out. Host and rig run the same code
// in different roles.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/bulk.h"
#include "protocol/bulk_receiver.h"
#include "protocol/framing.h"
#include "protocol/nodal.pb.h"
#include "protocol/outgoing_frames.h"

namespace nodal {

/// The limit of control frames waiting to be written, and of events waiting to be taken, before kOverload.
inline constexpr std::size_t kMaxControlQueueBytes = 8U << 20;
inline constexpr std::size_t kMaxEventQueueBytes = 8U << 20;
/// The same for a rig, which has 24 hosts and less memory: requests and pieces of uploads. A request in memory can be
/// four times larger than on the wire.
inline constexpr std::size_t kMaxRigEventQueueBytes = 256U << 10;
/// Replies that wait for one host: two calibrations, and lists.
inline constexpr std::size_t kMaxRigControlQueueBytes = 3U << 20;

enum class Role : std::uint8_t { kHost, kRig };

/// This program's protocol versions. Raise kProtocolMax with CHANGES.md; raise kProtocolMin at a removal.
inline constexpr std::uint32_t kProtocolMin = 1;
inline constexpr std::uint32_t kProtocolMax = 2;
/// Since this version an end answers pings.
inline constexpr std::uint32_t kProtocolPing = 2;

/// Features of a peer's hello, which name what its end can do; more are dropped. An empty name needs 20 times its bytes
/// in memory.
inline constexpr int kMaxFeatures = 64;

/// Longest name for whom a host asks (wire::Request.on_behalf), bytes.
inline constexpr std::size_t kMaxClaimBytes = 64;

/// A Hello with this program's versions; the caller adds other fields.
wire::Hello make_hello(std::string software);

struct StreamOpened {
  StreamId stream = 0;
  StreamPolicy policy = StreamPolicy::kLossless;
};
/// The peer has finished its stream. If `error` is set, an incomplete item stays incomplete.
struct StreamClosed {
  StreamId stream = 0;
  std::uint64_t offered = 0;
  std::uint64_t dropped = 0;
  std::optional<Error> error;
};
/// The peer wants no more of our stream; it is closed, and pending items are dropped.
struct StreamStopped {
  StreamId stream = 0;
  Error why;
};

using Event =
    std::variant<wire::Hello, wire::Request, wire::Reply, StreamOpened, BulkPiece, StreamClosed, StreamStopped>;

/// Hello first, then requests, replies and bulk streams. A control frame waits for at most one bulk piece (<= 64 KiB),
/// the one that is being written.
///
///   while (link.read gives bytes)      session.receive(bytes), then next_event() until it gives nothing
///   while (output() is not empty)      link.write(output()), session.sent(what it took)
///
/// Memory is bounded in both directions: received pieces by credits, which are returned when next_event() hands out
/// the pieces; control frames and events by the limits above. While wants_input() is false, leave bytes in the
/// link.
///
/// Threading: thread-bound.
/// Ownership: holds offered bodies until they are sent or dropped.
/// Errors: kProtocol, kChecksum, kTooLarge, kVersionMismatch from receive(), or the error in the
///   peer's Bye. The first error is final: every call returns it, earlier events can still be
///   taken, and output() holds a Bye for the peer; try once to write it before dropping the link. A
///   refusal by send(), offer() or open_stream() (kTooLarge, kOverload, kWrongState) changes
///   nothing.
class Session {
 public:
  Session(Role role, const wire::Hello& mine);

  // --- bytes in
  /// Consumes all of `bytes`; returns kOverload and consumes nothing while wants_input() is false. Pass the bytes of
  /// one read: their events may need about ten times as much memory.
  Status receive(std::span<const std::uint8_t> bytes);
  /// False while events are not taken or replies are not written: leave bytes in the link then.
  bool wants_input() const;
  /// The oldest event not yet taken. The peer's Hello is the first of them.
  std::optional<Event> next_event();
  /// The oldest event of its kind; other events stay queued. While pieces stay, the peer gets no credit for more.
  std::optional<wire::Reply> take_reply();
  std::optional<StreamStopped> take_stopped();
  /// Whether the stream may end here; kLinkClosed if the link closed inside a frame or an item.
  Status end_of_input() const;

  // --- bytes out
  /// Bytes to write next; not necessarily all. Valid until the next non-const call.
  std::span<const std::uint8_t> output() { return outgoing_.output(receiver_); }
  void sent(std::size_t bytes) { outgoing_.sent(bytes); }

  // --- what to say
  /// Hosts send requests, rigs send replies. kBadValue if a text is not UTF-8 (valid_utf8() corrects it).
  Status send(const wire::Request& request);
  Status send(const wire::Reply& reply);
  /// Ends the conversation and tells the peer the reason.
  void close(const Error& why);
  /// Asks the peer for a sign of life. Does nothing if the peer's version has no pings. The session answers the peer's
  /// pings by itself.
  void ping();

  // --- bulk
  Result<StreamId> open_stream(StreamPolicy policy);
  /// kOverload if a lossless queue is full; kWrongState if the stream is closed.
  Status offer(StreamId stream, BulkItem item);
  /// Closes after all pending items are sent. With an error: at once, and pending items are dropped.
  void close_stream(StreamId stream, std::optional<Error> error = std::nullopt);
  /// Asks the peer to send no more of a stream that it opened. Pieces already sent are discarded.
  void stop_stream(StreamId stream, const Error& why);
  /// Counts of a stream that this end opened, while it is open.
  std::optional<StreamCounts> counts(StreamId stream) const;
  /// Bytes of items on all streams that this end opened, that the link has taken.
  std::uint64_t bulk_taken() const { return outgoing_.streams().taken_bytes(); }
  /// Bytes of items on all streams that the peer opened, those of an incomplete frame included.
  std::uint64_t bulk_received() const { return receiver_.received_bytes() + under_way_of(std::nullopt); }
  /// The same for one stream, while it is open; 0 afterwards.
  std::uint64_t bulk_received(StreamId stream) const { return receiver_.received_bytes(stream) + under_way_of(stream); }

  // --- what is known
  /// Null until the peer's Hello has arrived.
  const wire::Hello* peer_hello() const { return peer_hello_ ? &*peer_hello_ : nullptr; }
  /// The protocol version in use: the highest that both ends support. 0 until the peer's Hello has arrived.
  std::uint32_t version() const { return version_; }
  /// Complete frames received, and received bytes of an incomplete one.
  std::uint32_t frames_received() const { return decoder_.frames(); }
  std::size_t bytes_under_way() const { return decoder_.under_way(); }
  /// The final error, or null.
  const Error* error() const { return dead_ ? &*dead_ : nullptr; }

 private:
  struct QueuedEvent {
    Event event;
    std::size_t bytes;
  };

  Status handle(const WireFrame& frame);
  Status handle_hello(const WireFrame& frame);
  Status handle_bye(const WireFrame& frame);
  Status handle_stream_open(const WireFrame& frame);
  Status handle_stream_close(const WireFrame& frame);
  Status handle_stream_stop(const WireFrame& frame);
  Status handle_credit(const WireFrame& frame);
  Status handle_bulk(const WireFrame& frame);
  void push_event(Event event, std::size_t bytes);
  template <class Kind>
  std::optional<Kind> take();
  /// Bytes of an item in the incomplete frame, if it is one of this stream; nothing: of any.
  std::uint64_t under_way_of(std::optional<StreamId> stream) const;

  Status send_message(FrameType type, const google::protobuf::MessageLite& message);
  tl::unexpected<Error> die(Error error, bool tell_peer);
  /// For example "the rig (nodald 0.1.0)".
  std::string peer_name() const;

  const Role role_;
  const wire::Hello mine_;
  std::optional<wire::Hello> peer_hello_;
  std::uint32_t version_ = 0;
  std::optional<Error> dead_;

  FrameDecoder decoder_;
  BulkReceiver receiver_;
  std::deque<QueuedEvent> events_;
  std::size_t event_bytes_ = 0;
  OutgoingFrames outgoing_;
};

template <class Kind>
std::optional<Kind> Session::take() {
  const auto of_kind = [](const QueuedEvent& queued) { return std::holds_alternative<Kind>(queued.event); };
  const auto found = std::ranges::find_if(events_, of_kind);
  if (found == events_.end()) return std::nullopt;
  std::optional<Kind> taken(std::get<Kind>(std::move(found->event)));
  event_bytes_ -= found->bytes;
  events_.erase(found);
  return taken;
}
inline std::optional<wire::Reply> Session::take_reply() { return take<wire::Reply>(); }
inline std::optional<StreamStopped> Session::take_stopped() { return take<StreamStopped>(); }

}  // namespace nodal
