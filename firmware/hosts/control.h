// The stage that talks to hosts.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/hosts/access.h"
#include "firmware/hosts/admission.h"
#include "firmware/hosts/client.h"
#include "firmware/hosts/device_listing.h"
#include "firmware/hosts/frame_sender.h"
#include "firmware/hosts/publisher.h"
#include "firmware/hosts/replies.h"
#include "firmware/hosts/take_sender.h"
#include "firmware/hosts/turns.h"
#include "firmware/operate/operation.h"
#include "hal/link.h"
#include "hal/watchdog.h"
#include "protocol/upload.h"

namespace nodal::firmware {

/// Accepts hosts, answers their requests, receives their uploads, sends them raymaps. A request that another stage must
/// carry out becomes a command of Operation, and is answered when that stage answers; meanwhile other hosts are served.
/// A request for what only one host can have at a time (Turn) waits in Turns, and is not refused.
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

  /// One function for each kind of request that is answered at once (requests.cpp).
  struct Answers;

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
  void drop_finished();
  bool serve_all(Instant now);
  bool serve(Client& client, Instant now);
  bool has_room(const Client& client, const wire::Request& request) const;
  void handle(Client& client, Event& event, Instant now);
  void handle(Client& client, const wire::Request& request, Instant now);
  bool serve_turns(Instant now);
  void carry_out(Client& client, const wire::Request& request, Instant now);
  /// Makes the request a command; the answer is sent when the command's stage has answered.
  Status command(Client& client, const wire::Request& request, Instant now);
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
  Replies replies_;
  Turns frame_sets_;
  Turns calibrations_;
  DeviceListing devices_;
  UploadReceiver uploads_;
  Publisher publisher_;
  FrameSender frame_sender_;
  TakeSender take_sender_;
  std::optional<Instant> ending_since_;
  std::atomic<bool> ended_{false};
  std::atomic<std::uint64_t> resident_bytes_{0};
};

}  // namespace nodal::firmware
