// A connection to a rig: the protocol's session over a link, driven by one thread that waits.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "hal/link.h"
#include "host_tool/rig/rig_address.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/nodal.pb.h"
#include "protocol/session.h"

namespace nodal::host {

/// Waits until the link may be read (or written, when asked), or the time is up. Tests put the rig's half of
/// the conversation in here.
using WaitForLink = std::function<void(hal::LinkPort& link, bool to_write, Duration at_most)>;
/// By poll(2) on the link's descriptors.
void wait_by_poll(hal::LinkPort& link, bool to_write, Duration at_most);

/// Threading: thread-bound.
/// Ownership: owns the link; closes it with the object.
/// Memory: what the rig may send without being asked is bounded by the session's windows. What it is asked for is checked
///   and made printable (rig_input.h) before a command sees it.
/// Errors: kUnreachable, kVersionMismatch, kTimeout, kLinkClosed, kProtocol, kTooLarge, what the rig answered, and
///   kCancelled after Ctrl-C. After an error of the link (3xx) every call gives it again.
class RigConnection {
 public:
  /// Connects and exchanges hellos. `patience`: how long the rig may take to answer anything.
  static Result<std::unique_ptr<RigConnection>> open(const RigAddress& address, Duration patience);
  static Result<std::unique_ptr<RigConnection>> over(std::unique_ptr<hal::LinkPort> link, std::string address,
                                                     Duration patience, WaitForLink wait);

  const wire::Hello& rig() const { return rig_; }
  const std::string& address() const { return address_; }

  /// Sends the request under a new id and waits for its answer. An error the rig answers is an error here.
  Result<wire::Reply> ask(wire::Request request);

  /// The same for requests that may take long, such as compiling a table: waits as long as the rig still answers
  /// status requests; `meanwhile` gets the rig's status every second.
  Result<wire::Reply> ask_long(wire::Request request, const std::function<void(const wire::RigStatus&)>& meanwhile);

  /// How long the rig may take to answer, and how long it may be silent: --timeout.
  Duration patience() const { return patience_; }

  /// The next of what comes on streams (StreamOpened, BulkPiece, StreamClosed, StreamStopped); nothing when
  /// `at_most` has passed. A rig that is silent is asked for its status, so that one that has nothing to send can be told
  /// from one that hangs; kTimeout when nothing at all came from it for patience().
  Result<std::optional<Event>> next_event(Duration at_most);
  /// The same of one stream; what comes on others is dropped.
  Result<std::optional<Event>> next_event_of(StreamId stream, Duration at_most);
  /// Waits so long, and sees meanwhile that the rig hangs or the link is lost. What comes on streams is dropped.
  Status rest(Duration how_long);

  /// Sends one item on a lossless stream and waits until the link has taken all of it; kTimeout when it takes no byte for
  /// patience().
  Status send_item(BulkItem item);

  /// Ends a stream of the rig's; its StreamClosed does not come any more.
  void stop_stream(StreamId stream);

 private:
  RigConnection(std::unique_ptr<hal::LinkPort> link, std::string address, Duration patience, WaitForLink wait);
  Status say_hello();
  /// Sorts replies by request for ask(); drops those without a waiting request.
  void sort_answers();
  /// Requests the status of a rig that has been silent for a while; an error when it stays silent.
  Status check_alive();
  /// Moves bytes both ways once; waits at most so long when there was nothing to move.
  Status step(Duration at_most);
  /// Steps until `done` says so; what comes on streams stays in the session. `what` names what was waited for. With
  /// `renewed`, `within` counts from when the link last took a byte.
  Status step_until(const std::function<bool()>& done, const std::string& what, Duration within, bool renewed = false);
  /// Sends the request; the id that its answer will have.
  Result<std::uint64_t> post(wire::Request& request);
  bool answered(std::uint64_t id) const { return questions_.at(id).has_value(); }
  Result<wire::Reply> take_answer(std::uint64_t id);
  tl::unexpected<Error> link_lost(const Error& error) const;

  std::unique_ptr<hal::LinkPort> link_;
  std::string address_;
  Duration patience_;
  WaitForLink wait_;
  Session session_;
  wire::Hello rig_;
  std::uint64_t next_request_ = 1;
  std::map<std::uint64_t, std::optional<wire::Reply>> questions_;  // by id, with the answer once it is there
  Duration heard_;                                                 // when bytes last came from the rig
  Duration sent_;                                                  // when the link last took bytes
  std::optional<std::uint64_t> probe_;  // the status request that a silent rig has not answered yet
  Duration probed_;                     // when it was sent
  std::optional<Error> dead_;
};

}  // namespace nodal::host
