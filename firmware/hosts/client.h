#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/frame/presence.h"
#include "firmware/hosts/access.h"
#include "firmware/hosts/host_activity.h"
#include "hal/link.h"
#include "protocol/base/units.h"
#include "protocol/session.h"
#include "protocol/upload.h"

namespace nodal::firmware {

/// A pull: a stream of raymaps to a client.
struct Pull {
  wire::PullRequest::Coding coding = wire::PullRequest::JPEG;
  bool lossless = false;
  std::uint64_t count = 0;    ///< requested number of raymaps; 0: until it is stopped
  std::uint64_t dropped = 0;  ///< raymaps that the session dropped, as of the newest step
  bool ended = false;         ///< the stream is closed; its last raymaps may still be in the queue
};

/// One host: its link, its session, its uploads and pulls. A host that breaks a rule only loses its own connection.
///
/// Threading: thread-bound to control.
/// Ownership: owns the link.
/// Errors: none; a client that broke a rule or disconnected is finished().
class Client {
 public:
  Client(std::uint64_t number, std::unique_ptr<hal::LinkPort> link, Access access, const wire::Hello& mine,
         Instant now);

  /// Reads received bytes, as many as the session accepts, and closes the client if a deadline has passed. True when it
  /// did something.
  bool pump_in(Instant now);
  /// Writes bytes, as many as the link accepts. True when it did something.
  bool pump_out(Instant now);
  /// Adds what wakes control for this host's link, after both found nothing to do.
  void add_wake_ups(hal::WakeUps& to);
  /// Closes the connection; the farewell with the reason is still sent.
  void end(const Error& why, Instant now);
  void on_hello(Instant now) { activity_.on_hello(now); }
  void on_request(Instant now) { activity_.on_request(now); }
  /// Call when it opens a stream for an upload.
  void on_upload(StreamId stream, Instant now) {
    uploads[stream];
    activity_.on_upload(now);
  }

  Session& session() { return session_; }
  const Session& session() const { return session_; }
  bool finished() const { return gone_; }
  /// It is being closed: only its farewell is still sent.
  bool ending() const { return gone_ || session_.error() != nullptr; }
  bool said_hello() const { return session_.peer_hello() != nullptr; }
  /// It pulls, uploads, or receives a frame set or a file of a take.
  bool has_work() const { return !pulls.empty() || !uploads.empty() || frame_set || take_file; }
  /// It waits for an answer, or its bytes move: it is not closed for another host.
  bool active(Instant now) const;
  const HostActivity& activity() const { return activity_; }
  std::uint64_t number() const { return number_; }
  const std::string& peer() const { return link_->peer(); }
  std::optional<hal::PeerIdentity> identity() const { return link_->identity(); }
  /// "host 3 at unix:...", for messages.
  const std::string& name() const { return name_; }
  const Error& why() const { return why_; }
  Access access() const { return access_; }
  /// "user 1000, process 4711, host 3 at unix:...", for the audit log.
  std::string who() const;
  /// The presence of the host, for the stages that carry out its requests.
  const Presence& presence() const { return presence_; }
  /// "user 1000 at the control socket".
  std::string party() const;

  std::map<StreamId, UploadStream> uploads;
  std::map<StreamId, Pull> pulls;
  std::optional<StreamId> frame_set;
  std::optional<StreamId> take_file;
  std::size_t requests_open = 0;
  bool logged = false;                ///< the log says that it is connected
  std::optional<wire::Request> held;  ///< its next request, while its stage has the most commands of this host
  std::uint64_t dropped = 0;          ///< raymaps dropped on streams that have ended
  std::uint64_t lossless_ended = 0;   ///< lossless pulls that ended because they were too slow
  bool leases = false;                ///< it may have temporary settings, which end when it is silent

 private:
  void finish(const Error& why);

  const std::uint64_t number_;
  std::unique_ptr<hal::LinkPort> link_;
  const Access access_;
  std::string name_;
  const Presence presence_ = Presence::of_host();
  Session session_;
  HostActivity activity_;
  std::optional<Instant> ending_since_;
  bool gone_ = false;
  Error why_;
};

using Clients = std::vector<std::unique_ptr<Client>>;

}  // namespace nodal::firmware
