// A conversation with a rig: the protocol's session over a link, driven from one thread that waits.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "hal/link.h"
#include "host_tool/rig_address.h"
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
/// Errors: kUnreachable, kVersionMismatch, kTimeout, kLinkClosed, kProtocol, what the rig answered, and
///   kCancelled after Ctrl-C. After an error of the link (3xx) every call gives it again.
class RigConnection {
 public:
  /// Connects and exchanges hellos. `patience`: how long the rig may take to answer anything.
  static Result<std::unique_ptr<RigConnection>> open(const RigAddress& address, Duration patience);
  static Result<std::unique_ptr<RigConnection>> over(std::unique_ptr<hal::LinkPort> link, std::string address,
                                                     Duration patience, WaitForLink wait);

  const wire::Hello& rig() const { return *session_.peer_hello(); }
  const std::string& address() const { return address_; }

  /// Sends the request under a new id and waits for its answer. An error the rig answers is an error here.
  Result<wire::Reply> ask(wire::Request request);

  /// The same for what may take long, such as compiling a table: as long as the rig answers at all, its answer is
  /// waited for, and `meanwhile` is told every second how the rig is.
  Result<wire::Reply> ask_long(wire::Request request, const std::function<void(const wire::RigStatus&)>& meanwhile);

  /// The next of what comes on streams (StreamOpened, BulkPiece, StreamClosed, StreamStopped); nothing when
  /// `at_most` has passed.
  Result<std::optional<Event>> next_event(Duration at_most);

  /// Sends one item on a lossless stream and waits until the link has taken all of it.
  Status send_item(BulkItem item);

  /// Ends a stream of the rig's; its StreamClosed does not come any more.
  void stop_stream(StreamId stream);

 private:
  RigConnection(std::unique_ptr<hal::LinkPort> link, std::string address, Duration patience, WaitForLink wait);
  Status say_hello();
  /// What was put aside, then what the session has.
  std::optional<Event> take_event();
  /// Moves bytes both ways once; waits at most so long when there was nothing to move.
  Status step(Duration at_most);
  /// Steps until `done` says so, with what comes meanwhile put aside. `what` names what was waited for.
  Status step_until(const std::function<bool()>& done, const std::string& what, Duration within);
  Status step_until(const std::function<bool()>& done, const std::string& what) {
    return step_until(done, what, patience_);
  }
  /// Sends the request; the id that its answer will have.
  Result<std::uint64_t> post(wire::Request& request);
  bool answered(std::uint64_t id) const;
  Result<wire::Reply> take_answer(std::uint64_t id);
  tl::unexpected<Error> link_lost(const Error& error) const;

  std::unique_ptr<hal::LinkPort> link_;
  std::string address_;
  Duration patience_;
  WaitForLink wait_;
  Session session_;
  std::uint64_t next_request_ = 1;
  std::deque<wire::Reply> replies_;
  std::deque<Event> events_;  // of streams, that came while an answer was waited for
  std::optional<Error> dead_;
};

}  // namespace nodal::host
