#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/hosts/access.h"
#include "hal/link.h"
#include "protocol/base/units.h"
#include "protocol/session.h"
#include "protocol/upload.h"

namespace nodal::firmware {

/// Raymaps on their way to a client, by one stream.
struct Pull {
  wire::PullRequest::Coding coding = wire::PullRequest::JPEG;
  bool lossless = false;
  std::uint64_t count = 0;    ///< wanted in all; 0: until it is stopped
  std::uint64_t dropped = 0;  ///< when last looked at
  bool ended = false;         ///< closed; its last raymaps may still be going out
};

/// One host: its link, its session, what it uploads and pulls. Whatever it does, it loses no more than itself.
///
/// Threading: thread-bound to control.
/// Ownership: owns the link.
/// Errors: none; a client that broke a rule, or left, is finished().
class Client {
 public:
  Client(std::uint64_t number, std::unique_ptr<hal::LinkPort> link, Access access, const wire::Hello& mine,
         Instant now);

  /// Reads what came, as far as the session takes it, and ends a client that keeps a deadline waiting. True when there
  /// was anything.
  bool pump_in(Instant now);
  /// Writes what the link takes.
  bool pump_out(Instant now);
  /// Ends it from here; the farewell still goes out.
  void end(const Error& why, Instant now);
  /// It said hello: it is not idle.
  void used(Instant now) { used_ = now; }
  /// It asked for something.
  void asked(Instant now) {
    used_ = now;
    has_asked_ = true;
  }

  Session& session() { return session_; }
  const Session& session() const { return session_; }
  bool finished() const { return gone_; }
  /// It is told why it is closed; nothing else is done for it.
  bool ending() const { return gone_ || session_.error() != nullptr; }
  bool said_hello() const { return session_.peer_hello() != nullptr; }
  /// It pulls, uploads or takes a frame set.
  bool works() const { return !pulls.empty() || !uploads.empty() || frame_set.has_value(); }
  /// It waits for the rig, or its bytes move: it is not closed to make room.
  bool active(Instant now) const;
  /// When its link last took bytes.
  Instant written() const { return written_; }
  /// Since its last request, or since bytes of its work moved.
  Instant idle_since() const { return used_; }
  Instant since() const { return since_; }
  bool has_asked() const { return has_asked_; }
  std::uint64_t number() const { return number_; }
  const std::string& peer() const { return link_->peer(); }
  std::optional<hal::PeerIdentity> identity() const { return link_->identity(); }
  /// "host 3 at unix:...", for messages.
  const std::string& name() const { return name_; }
  const Error& why() const { return why_; }
  Access access() const { return access_; }
  /// "user 1000, process 4711, host 3 at unix:...", for the audit log.
  std::string who() const;
  std::uint64_t bytes_in() const { return bytes_in_; }
  std::uint64_t bytes_out() const { return bytes_out_; }

  std::map<StreamId, UploadStream> uploads;
  std::map<StreamId, Pull> pulls;
  std::optional<StreamId> frame_set;
  std::size_t requests_open = 0;
  std::optional<wire::Request> held;  ///< the next one, while that stage has as many of this host's as it may
  std::uint64_t dropped = 0;          ///< raymaps, on streams that have ended
  std::uint64_t lossless_ended = 0;   ///< lossless pulls that were too slow

  static constexpr Duration kHelloWithin = Duration::seconds(2);  ///< a host says it at once
  /// A frame that has begun is whole within so long, and a second more for each kSlowestBytes of it: one bulk frame is
  /// 64 KiB, and a link may be slow but not stand still.
  static constexpr Duration kFrameWithin = Duration::seconds(2);
  static constexpr std::size_t kSlowestBytes = 8U << 10;
  /// Work whose bytes do not move for so long is stalled.
  static constexpr Duration kStalledAfter = Duration::seconds(10);
  /// A silent host is pinged, and closed when it answers nothing. Long, because `nodal` may compute between requests.
  static constexpr Duration kPingEvery = Duration::seconds(30);
  static constexpr Duration kSilentFor = Duration::seconds(300);

 private:
  void go(const Error& why);
  /// Why its time is up, if it is.
  std::optional<Error> overdue(Instant now) const;

  const std::uint64_t number_;
  std::unique_ptr<hal::LinkPort> link_;
  const Access access_;
  std::string name_;
  Session session_;
  const Instant since_;
  Instant used_;
  bool has_asked_ = false;
  Instant heard_;    ///< bytes came
  Instant written_;  ///< bytes were taken
  Instant pinged_;
  Instant frame_since_;       ///< when the frame under way began
  std::uint32_t frames_ = 0;  ///< frames_received() when frame_since_ was set
  std::uint64_t bytes_in_ = 0;
  std::uint64_t bytes_out_ = 0;
  std::optional<Instant> dying_since_;
  bool gone_ = false;
  Error why_;
};

using Clients = std::vector<std::unique_ptr<Client>>;

}  // namespace nodal::firmware
