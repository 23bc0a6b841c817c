// A connection to a rig: the protocol's session over a link, run by one thread that may wait.
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

/// Waits until the link is readable (or, if `to_write`, writable), or the time is up. Tests run the rig's half of the
/// conversation in this function.
using WaitForLink = std::function<void(hal::LinkPort& link, bool to_write, Duration at_most)>;
/// By poll(2) on the link's descriptors.
void wait_by_poll(hal::LinkPort& link, bool to_write, Duration at_most);

/// Threading: thread-bound.
/// Ownership: owns the link; closes it with the object.
/// Memory: the session's windows bound what the rig can send without a request. Replies are checked and made printable
///   (rig_input.h) before a command sees them.
/// Errors: kUnreachable, kVersionMismatch, kTimeout, kLinkClosed, kProtocol, kTooLarge, errors that the rig replies,
///   and kCancelled after Ctrl-C. After an error of the link (3xx) every call returns it again.
class RigConnection {
 public:
  /// Connects and exchanges Hellos. `patience`: the longest time for any answer of the rig.
  static Result<std::unique_ptr<RigConnection>> open(const RigAddress& address, Duration patience);
  static Result<std::unique_ptr<RigConnection>> over(std::unique_ptr<hal::LinkPort> link, std::string address,
                                                     Duration patience, WaitForLink wait);

  const wire::Hello& rig() const { return rig_; }
  const std::string& address() const { return address_; }

  /// Sends the request with a new id and waits for its answer. An error in the rig's reply is returned as an error.
  Result<wire::Reply> ask(wire::Request request);

  /// The same for requests that may take long, such as compiling a table: waits as long as the rig answers status
  /// requests; calls `meanwhile` with the rig's status every second.
  Result<wire::Reply> ask_long(wire::Request request, const std::function<void(const wire::RigStatus&)>& meanwhile);

  /// The longest time for an answer, and of silence: --timeout.
  Duration patience() const { return patience_; }

  /// The next event of a stream (StreamOpened, BulkPiece, StreamClosed, StreamStopped); nothing after `at_most`. A
  /// silent rig is asked for its status, to distinguish one that has nothing to send from one that hangs; kTimeout if
  /// nothing arrives from it for patience().
  Result<std::optional<Event>> next_event(Duration at_most);
  /// The same for one stream; events of other streams are dropped.
  Result<std::optional<Event>> next_event_of(StreamId stream, Duration at_most);
  /// Waits for `how_long`; returns an error if the rig hangs or the link is lost. Events of streams are dropped.
  Status rest(Duration how_long);

  /// Sends one item on a lossless stream and waits until the link has accepted all of it; kTimeout if it accepts no
  /// byte for patience().
  Status send_item(BulkItem item);

  /// Stops a stream of the rig; its StreamClosed is not delivered.
  void stop_stream(StreamId stream);

 private:
  RigConnection(std::unique_ptr<hal::LinkPort> link, std::string address, Duration patience, WaitForLink wait);
  Status say_hello();
  /// Sorts replies by request for ask(); drops those without a waiting request.
  void sort_answers();
  /// Requests the status of a rig that has been silent for a while; an error when it stays silent.
  Status check_alive();
  /// Moves bytes in both directions once; waits at most `at_most` if there are none to move.
  Status step(Duration at_most);
  /// Steps until done() is true; events of streams stay in the session. `what` names the awaited event in errors. With
  /// `renewed`, `within` starts again whenever the link accepts a byte.
  Status step_until(const std::function<bool()>& done, const std::string& what, Duration within, bool renewed = false);
  /// Sends the request; returns the id of its answer.
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
  std::map<std::uint64_t, std::optional<wire::Reply>> questions_;  // by id, with the answer once received
  Duration heard_;                                                 // time of the last bytes from the rig
  Duration sent_;                                                  // time when the link last accepted bytes
  std::optional<std::uint64_t> probe_;                             // the unanswered status request to a silent rig
  Duration probed_;                                                // when it was sent
  std::optional<Error> dead_;
};

}  // namespace nodal::host
