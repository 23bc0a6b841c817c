// One end of a conversation, without the link: bytes go in, events and bytes come out. Host and rig are the
// same but for their roles.
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
#include "protocol/bulk_sender.h"
#include "protocol/framing.h"
#include "protocol/nodal.pb.h"

namespace nodal {

/// Control frames that may wait to be written, and events to be taken, before a session says kOverload.
inline constexpr std::size_t kMaxControlQueueBytes = 8U << 20;
inline constexpr std::size_t kMaxEventQueueBytes = 8U << 20;
/// The same of a rig, which has many hosts and less memory: requests and pieces of uploads. A request in memory can be
/// several times as large as on the wire.
inline constexpr std::size_t kMaxRigEventQueueBytes = 1U << 20;

enum class Role : std::uint8_t { kHost, kRig };

/// What this program speaks. Raise kProtocolMax with CHANGES.md; raise kProtocolMin when something is gone.
inline constexpr std::uint32_t kProtocolMin = 1;
inline constexpr std::uint32_t kProtocolMax = 2;
/// From this version on an end answers pings.
inline constexpr std::uint32_t kProtocolPing = 2;

/// A Hello with this program's versions; the caller adds what else it wants to say.
wire::Hello make_hello(std::string software);

struct StreamOpened {
  StreamId stream = 0;
  StreamPolicy policy = StreamPolicy::kLossless;
};
/// The peer will send no more on its stream. `error` is set when the item under way, if any, stays torn.
struct StreamClosed {
  StreamId stream = 0;
  std::uint64_t offered = 0;
  std::uint64_t dropped = 0;
  std::optional<Error> error;
};
/// The peer wants no more of our stream; it is closed, and what was pending is dropped.
struct StreamStopped {
  StreamId stream = 0;
  Error why;
};

using Event =
    std::variant<wire::Hello, wire::Request, wire::Reply, StreamOpened, BulkPiece, StreamClosed, StreamStopped>;

/// Hello first, then requests, replies and bulk streams. A control frame never waits behind more than the
/// one bulk piece (<= 64 KiB) that is under way.
///
///   while (link.read gives bytes)      session.receive(bytes), then next_event() until it gives nothing
///   while (output() is not empty)      link.write(output()), session.sent(what it took)
///
/// Memory is bounded both ways: received pieces by credits, which are given back as next_event() hands
/// pieces out; control frames and events by the limits above.
/// While !wants_input(), leave bytes in the link.
///
/// Threading: thread-bound.
/// Ownership: holds the bodies it was offered until they are sent or dropped.
/// Errors: kProtocol, kChecksum, kTooLarge, kVersionMismatch from receive(), or what the peer said in its
///   farewell. The first is final: the session is dead, every call gives that error, events that came before
///   it can still be taken, and output() holds a farewell that tells the peer, worth one try at writing
///   before the link is dropped. What send(), offer() and open_stream() refuse (kTooLarge, kOverload,
///   kWrongState) changes nothing.
class Session {
 public:
  Session(Role role, const wire::Hello& mine);

  // --- bytes in
  /// Takes all of it; kOverload, and nothing taken, while !wants_input(). Give it what one read gave: its
  /// events may take some ten times as many bytes as it has.
  Status receive(std::span<const std::uint8_t> bytes);
  /// False while events are not taken or replies not written: time to leave bytes in the link.
  bool wants_input() const;
  /// The oldest event not yet taken. The peer's Hello is the first of them.
  std::optional<Event> next_event();
  /// The oldest event of its kind, past others, which stay. While pieces stay, the peer gets no credit for more.
  std::optional<wire::Reply> take_reply();
  std::optional<StreamStopped> take_stopped();
  /// Says whether the stream may end here; kLinkClosed when the link went down inside a frame or an item.
  Status end_of_input() const;

  // --- bytes out
  /// Bytes to write next; not all there are. Valid until the next call that is not const.
  std::span<const std::uint8_t> output();
  void sent(std::size_t bytes);

  // --- what to say
  /// Hosts make requests, rigs give replies. kBadValue when a text is not UTF-8 (valid_utf8() makes it so).
  Status send(const wire::Request& request);
  Status send(const wire::Reply& reply);
  /// Ends the conversation from this end: the peer is told why.
  void close(const Error& why);
  /// Asks for a sign of life. Does nothing for a peer of a version without pings. A ping of the peer's is answered
  /// without a call.
  void ping();

  // --- bulk
  Result<StreamId> open_stream(StreamPolicy policy);
  /// kOverload when a lossless queue is full; kWrongState when the stream is closed.
  Status offer(StreamId stream, BulkItem item);
  /// After what is pending. With an error: at once, and what is pending is dropped.
  void close_stream(StreamId stream, std::optional<Error> error = std::nullopt);
  /// Of a stream the peer opened: asks it to send no more. Pieces under way are thrown away.
  void stop_stream(StreamId stream, const Error& why);
  /// Of a stream of ours, as long as it is open.
  std::optional<StreamCounts> counts(StreamId stream) const;

  // --- what is known
  /// Null until its Hello came.
  const wire::Hello* peer_hello() const { return peer_hello_ ? &*peer_hello_ : nullptr; }
  /// The version both ends speak: the highest in common. 0 until the peer's Hello came.
  std::uint32_t version() const { return version_; }
  /// Of what came: whole frames, and bytes of a frame that is not whole yet.
  std::uint32_t frames_received() const { return decoder_.frames(); }
  std::size_t bytes_under_way() const { return decoder_.under_way(); }
  /// Why it is dead, or null.
  const Error* error() const { return dead_ ? &*dead_ : nullptr; }

 private:
  struct QueuedFrame {
    FrameType type;
    StreamId stream;
    std::string payload;
  };
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

  Status send_message(FrameType type, const google::protobuf::MessageLite& message);
  void push_control(FrameType type, StreamId stream, std::string payload);
  void next_front();
  void append_closes();
  void append_control(FrameType type, StreamId stream, const std::string& payload);
  tl::unexpected<Error> die(Error error, bool tell_peer);
  /// "the rig (nodald 0.1.0)".
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

  BulkSender sender_;
  std::deque<QueuedFrame> control_;
  std::size_t control_bytes_ = 0;
  bool ping_due_ = false;
  bool pong_due_ = false;  // one answers any number of pings
  std::uint32_t sequence_ = 0;
  // What is being written: frames of our own, then a slice of somebody's body.
  std::vector<std::uint8_t> front_;
  SharedBytes front_slice_;
  std::size_t front_sent_ = 0;
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
