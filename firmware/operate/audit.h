// The audit log: every change of the rig with its author, its time, the old and the new value, and its result.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "firmware/operate/commands.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

struct AuditEntry {
  std::uint64_t number = 0;  ///< of the entry since the start, from 1
  Instant at;
  std::string who;             ///< "user 1000, process 4711, host 3 at unix:...", "button", "stored settings"
  std::string what;            ///< command_name()
  std::string before;          ///< the values that the command changes, before it
  std::string after;           ///< the requested values; for a calibration, the one in force after the command
  std::optional<Error> error;  ///< empty: the command succeeded
};

/// Keeps the newest kKept entries for hosts. The daemon's log gets all entries, within its rate limit (news.h).
///
/// Threading: thread-bound to control.
/// Ownership: none.
/// Errors: none.
class AuditLog {
 public:
  static constexpr std::size_t kKept = 256;
  static constexpr std::size_t kLongestText = 240;  ///< bytes of each text; a reply with kKept entries is below 300 KiB

  /// Sanitises and keeps an entry. Returns its line for the log, which begins with "audit: ".
  std::string record(AuditEntry entry);
  /// Oldest first.
  const std::deque<AuditEntry>& entries() const { return entries_; }

 private:
  std::deque<AuditEntry> entries_;
  std::uint64_t count_ = 0;
};

/// The present values of what a command changes; only those that the command names.
std::string values_before(const Command& command, const CaptureReport& capture, const KeeperReport& keeper);
/// The values that a command requests. For a command about calibrations: `in_force`, the one in force after it.
std::string values_after(const Command& command, const RigConfig& config, const std::optional<Sha256>& in_force);
/// "calibration 0123456789ab", "no calibration".
std::string calibration_text(const std::optional<Sha256>& id);

}  // namespace nodal::firmware
