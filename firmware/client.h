#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "firmware/access.h"
#include "hal/link.h"
#include "protocol/base/units.h"
#include "protocol/session.h"
#include "protocol/upload.h"

namespace nodal::firmware {

/// Raymaps on their way to a client, by one stream.
struct Pull {
  wire::PullRequest::Coding coding = wire::PullRequest::JPEG;
  bool lossless = false;
  std::uint64_t count = 0;              ///< wanted in all; 0: until it is stopped
  std::uint64_t delivered = 0;          ///< when last looked at
  std::uint64_t dropped = 0;            ///< likewise
  std::optional<Instant> stuck_since;   ///< lossless, and its queue is full
  bool ended = false;                   ///< closed; its last raymaps may still be going out
};

/// One host: its link, its session, what it uploads and pulls. Whatever it does, it loses no more than itself.
///
/// Threading: thread-bound to control.
/// Ownership: owns the link.
/// Errors: none; a client that broke a rule, or left, is finished().
class Client {
 public:
  Client(std::uint64_t number, std::unique_ptr<hal::LinkPort> link, Access access, const wire::Hello& mine, Instant now);

  /// Reads what came, as far as the session takes it. True when there was anything.
  bool pump_in(Instant now);
  /// Writes what the link takes.
  bool pump_out(Instant now);
  /// Ends it from here; the farewell still goes out.
  void end(const Error& why, Instant now);

  Session& session() { return session_; }
  bool finished() const { return gone_; }
  std::uint64_t number() const { return number_; }
  /// "host 3 at unix:...", for messages.
  const std::string& name() const { return name_; }
  const Error& why() const { return why_; }
  Access access() const { return access_; }
  /// "user 1000, process 4711, host 3 at unix:...", for the audit log.
  std::string who() const;

  std::map<StreamId, UploadStream> uploads;
  std::map<StreamId, Pull> pulls;
  std::size_t requests_open = 0;
  std::uint64_t dropped = 0;  ///< raymaps, on streams that have ended

  static constexpr Duration kHelloWithin = Duration::seconds(10);

 private:
  void go(const Error& why);

  const std::uint64_t number_;
  std::unique_ptr<hal::LinkPort> link_;
  const Access access_;
  std::string name_;
  Session session_;
  const Instant since_;
  std::optional<Instant> dying_since_;
  bool gone_ = false;
  Error why_;
};

}  // namespace nodal::firmware
