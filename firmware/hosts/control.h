// The stage that talks to hosts.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/hosts/access.h"
#include "firmware/hosts/admission.h"
#include "firmware/hosts/client.h"
#include "firmware/hosts/device_scan.h"
#include "firmware/hosts/fair_queue.h"
#include "firmware/hosts/frame_sender.h"
#include "firmware/hosts/publisher.h"
#include "firmware/hosts/take_sender.h"
#include "firmware/operate/operation.h"
#include "hal/link.h"
#include "hal/watchdog.h"
#include "protocol/upload.h"

namespace nodal::firmware {

/// Accepts hosts, answers their requests, receives their uploads, sends them raymaps. A request that another stage must
/// carry out becomes a command of Operation, and is answered when that stage answers; meanwhile other hosts are served.
/// A request for what only one host can have at a time (Turn) waits in a FairQueue, and is not refused.
///
/// Threading: step() is thread-bound to control; set_resident_bytes(), ask_to_end() and ended() are for any thread.
/// Ownership: owns the clients; listeners and stages outlive it.
/// Errors: a host's errors are sent to it as replies; take_news() returns messages for the operator.
class Control {
 public:
  /// `frame_sets`: the sets for hosts that request the heads' own pictures. `scan`: null if the rig cannot list
  /// devices.
  Control(const RigConfig& config, std::string software, const Stages& stages, Outlet<SetLoan>& frame_sets,
          std::vector<Listener> listeners, hal::WatchdogPort* watchdog, const PanelPins& panel, DeviceScan* scan,
          Instant now);
  ~Control();

  /// True when it did something.
  bool step(Instant now);

  /// Adds what wakes the thread, after step() returned false: hosts and their links, and the operation's deadlines.
  /// Other stages wake it too, by a bell.
  void add_wake_ups(hal::WakeUps& to) const;

  /// Sentences for the log since the last call: connections of hosts, changes of the state.
  std::vector<std::string> take_news() { return operation_.news().take(); }
  const Health& health() const { return operation_.health(); }
  /// Starts the end of the rig: hosts get the reason, no more hosts are accepted. Any thread; call it once.
  void ask_to_end(std::string reason) { operation_.ask_to_end(std::move(reason)); }
  /// Every host has received its farewell, or kFarewell has passed. Any thread.
  bool ended() const { return ended_.load(std::memory_order_acquire); }
  std::size_t clients() const { return clients_.size(); }
  void set_resident_bytes(std::uint64_t bytes) { resident_bytes_.store(bytes, std::memory_order_relaxed); }
  wire::RigStatus status(Instant now);
  /// Frame sets that the blend missed because its queue was full, as of the newest step.
  std::uint64_t sets_missed_by_blend() const { return RigWatch::sets_missed_by_blend(operation_.capture()); }

  static constexpr Duration kFarewell = Duration::milliseconds(500);
  static constexpr std::size_t kMaxRequests = 16;  ///< unanswered requests of one client
  /// The most unanswered commands of one client at another stage: so few that the stage's ring has room for all
  /// clients.
  static constexpr std::size_t kCaptureRequests = 4;
  static constexpr std::size_t kSlowRequests = 1;
  /// Requests of one client in one step. A status takes about 10 us, so a client that floods the rig with requests
  /// delays the others by less than 0.1 ms a step; its further requests wait in its session, and then in its link.
  static constexpr int kRequestsAStep = 8;
  static constexpr int kEventsAStep = 64;              ///< events of all kinds: 4 MiB of pieces
  static constexpr std::size_t kUploadsOfAClient = 2;  ///< incomplete uploads of one client

 private:
  /// A host's request that is not answered yet.
  struct Waiting {
    std::uint64_t client = 0;
    std::uint64_t request = 0;  ///< id of the request
  };

  /// Requests that wait for their turn, one of each host.
  struct Turns {
    FairQueue order;
    std::map<std::uint64_t, wire::Request> requests;  ///< by host
  };

  void drop_finished();
  void watch_leases(Instant now);
  bool serve_all(Instant now);
  bool serve(Client& client, Instant now);
  bool has_room(const Client& client, const wire::Request& request) const;
  void handle(Client& client, Event& event, Instant now);
  void handle(Client& client, const wire::Request& request, Instant now);
  /// Answers a request at once. Returns the error to reply with, if any.
  Status answer(Client& client, const wire::Request& request, Instant now);
  Turns* turns_for(const wire::Request& request);
  bool serve_turns(Instant now);
  bool serve_next(Turns& turns, Instant now);
  void carry_out(Client& client, const wire::Request& request, Instant now);
  Status command(Client& client, const wire::Request& request, Instant now);
  Result<Command> commit_command(const wire::UploadCommit& commit);
  Result<StreamId> start_work(Client& client, const wire::Request& request, Instant now);
  Status end_host(Client& client, const wire::Request& request, Instant now);
  void await(Client& client, const wire::Request& request, Ticket ticket);
  Status list_devices(Client& client, std::uint64_t request);
  bool reply_to_scans(Instant now);
  void reply(Client& client, const wire::Reply& reply, Instant now);
  void refuse(Client& client, std::uint64_t request, const Error& error, Instant now);
  bool reply_to_commands(Instant now);
  Client* find(std::uint64_t number);
  void end(Instant now);
  wire::Hello hello(Access access) const;
  void say(NewsKind kind, std::string sentence) { operation_.news().say(kind, std::move(sentence)); }

  const RigConfig config_;
  const std::string software_;
  Stages stages_;
  Operation operation_;
  Admission admission_;
  const Instant started_;
  Instant now_;  ///< time of the newest step

  Clients clients_;
  std::size_t first_served_ = 0;  ///< index of the client that is served first; rises by one each step
  std::map<Ticket, Waiting> waiting_;
  Turns frame_sets_;
  Turns calibrations_;
  std::optional<Ticket> calibration_;  ///< the change of a calibration that the keeper works on
  DeviceScan* scan_;
  std::vector<Waiting> scanning_;  ///< requests that the scan in progress will answer
  UploadReceiver uploads_;
  Publisher publisher_;
  FrameSender frame_sender_;
  TakeSender take_sender_;
  std::optional<Instant> ending_since_;
  std::atomic<bool> ended_{false};
  std::atomic<std::uint64_t> resident_bytes_{0};
};

}  // namespace nodal::firmware
