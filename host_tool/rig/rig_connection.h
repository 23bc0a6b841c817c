// A connection to a rig: the protocol's session over a link, run by one thread that may wait.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "hal/link.h"
#include "host_tool/rig/progress_floor.h"
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

/// The time since any fixed moment. Tests bring their own.
using HostClock = std::function<Duration()>;
/// The system's monotonic clock.
Duration steady_now();

/// Opens the link to a rig. Errors: those of the kind of link.
using OpenLink = std::function<Result<std::unique_ptr<hal::LinkPort>>(const RigAddress& address)>;
/// In this process.
Result<std::unique_ptr<hal::LinkPort>> open_link(const RigAddress& address);

/// Threading: thread-bound.
/// Ownership: owns the link; closes it with the object.
/// Memory: the session's windows bound what the rig can send without a request. Replies are checked and made printable
///   (rig_input.h) before a command sees them.
/// Errors: kUnreachable, kVersionMismatch, kTimeout, kLinkClosed, kProtocol, kTooLarge, errors that the rig replies,
///   and kCancelled after Ctrl-C. After an error of the link (3xx) every call returns it again.
class RigConnection {
 public:
  /// Connects and exchanges Hellos. `patience`: the longest time for any answer of the rig.
  static Result<std::unique_ptr<RigConnection>> open(const RigAddress& address, Duration patience,
                                                     const OpenLink& link = open_link);
  static Result<std::unique_ptr<RigConnection>> over(std::unique_ptr<hal::LinkPort> link, std::string address,
                                                     Duration patience, WaitForLink wait, HostClock clock = steady_now);

  const wire::Hello& rig() const { return rig_; }
  const std::string& address() const { return address_; }

  /// Sends the request with a new id and waits for its answer. An error in the rig's reply is returned as an error.
  Result<wire::Reply> ask(wire::Request request);

  /// The same for requests that may take long, such as compiling a table: waits as long as the rig answers status
  /// requests and its activity changes (ActivityFloor); calls `meanwhile` with the rig's status every second.
  Result<wire::Reply> ask_long(wire::Request request, const std::function<void(const wire::RigStatus&)>& meanwhile);

  /// The longest time for an answer, and of silence: --timeout.
  Duration patience() const { return patience_; }
  Duration now() const { return clock_(); }

  /// The next event of a stream (StreamOpened, BulkPiece, StreamClosed, StreamStopped); nothing after `at_most`. A
  /// silent rig is asked for its status, to distinguish one that has nothing to send from one that hangs; kTimeout if
  /// neither an answer nor kMinBytesAWindow arrive from it within patience().
  Result<std::optional<Event>> next_event(Duration at_most);
  /// The same for one stream; events of other streams are dropped.
  Result<std::optional<Event>> next_event_of(StreamId stream, Duration at_most);
  /// Bytes of a stream's items that have arrived, those of an incomplete piece included; 0 once the stream is closed.
  std::uint64_t received(StreamId stream) const { return session_.bulk_received(stream); }
  /// Waits for `how_long`; returns an error if the rig hangs or the link is lost. Events of streams are dropped.
  Status rest(Duration how_long);

  /// Sends one item on a lossless stream and waits until the link has accepted all of it; kTimeout if it accepts less
  /// than kMinBytesAWindow in patience().
  Status send_item(BulkItem item);

  /// Stops a stream of the rig; its StreamClosed is not delivered.
  void stop_stream(StreamId stream);

 private:
  RigConnection(std::unique_ptr<hal::LinkPort> link, std::string address, Duration patience, WaitForLink wait,
                HostClock clock);
  Status say_hello();
  /// Sorts replies by request for ask(); drops those without a waiting request.
  void sort_answers();
  /// Requests the status of a rig that has been silent for a while; an error when it stays silent.
  Status check_alive();
  /// Moves bytes in both directions once; waits at most `at_most` if there are none to move.
  Status step(Duration at_most);
  /// Steps until done() is true; events of streams stay in the session. `what` names the awaited event in errors. With
  /// `floor`, `within` is its window, and the wait ends only when it has stalled.
  Status step_until(const std::function<bool()>& done, const std::string& what, Duration within,
                    ProgressFloor* floor = nullptr);
  /// Sends the request; returns the id of its answer.
  Result<std::uint64_t> post(wire::Request& request);
  bool answered(std::uint64_t id) const { return questions_.at(id).has_value(); }
  Result<wire::Reply> take_answer(std::uint64_t id);
  tl::unexpected<Error> link_lost(const Error& error) const;

  std::unique_ptr<hal::LinkPort> link_;
  std::string address_;
  Duration patience_;
  WaitForLink wait_;
  HostClock clock_;
  Session session_;
  wire::Hello rig_;
  std::uint64_t next_request_ = 1;
  std::map<std::uint64_t, std::optional<wire::Reply>> questions_;  // by id, with the answer once received
  Duration received_at_;                                           // time of the last bytes from the rig
  ProgressFloor quiet_;                                            // when it stalls, the rig is asked for its status
  std::optional<std::uint64_t> probe_;                             // number of that request, while it is unanswered
  ProgressFloor probed_;                                           // progress while its answer is awaited
  std::optional<Error> dead_;
};

}  // namespace nodal::host
