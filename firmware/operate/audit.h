// Every change of the rig: who made it, what it was before and after, when, and whether it succeeded.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "firmware/operate/commands.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

struct AuditEntry {
  std::uint64_t number = 0;  ///< counts all entries since the start, from 1
  Instant at;
  std::string who;     ///< "user 1000, process 4711, host 3 at unix:...", "button", "settings of the last start"
  std::string what;    ///< command_name()
  std::string before;  ///< of what the command changes
  std::string after;   ///< asked for, or in force now
  std::optional<Error> error;  ///< nothing: it was carried out
};

/// The newest entries, for hosts that ask; the log has all of them, as far as its allowance goes (news.h).
///
/// Threading: thread-bound to control.
/// Ownership: none.
/// Errors: none.
class AuditLog {
 public:
  static constexpr std::size_t kKept = 256;
  static constexpr std::size_t kLongestText = 240;  ///< bytes of each text; with kKept a reply of under 300 KiB

  /// Sanitises and keeps it; the line for the log, which begins with "audit: ".
  std::string record(AuditEntry entry);
  /// Oldest first.
  const std::deque<AuditEntry>& entries() const { return entries_; }

 private:
  std::deque<AuditEntry> entries_;
  std::uint64_t count_ = 0;
};

/// What a command would change, as it is now: only the values that it names.
std::string values_before(const Command& command, const CaptureReport& capture, const KeeperReport& keeper);
/// What a command asks for. Of a calibration that is in force by now: which.
std::string values_after(const Command& command, const RigConfig& config, const std::optional<Sha256>& in_force);
/// "calibration 0123456789ab", "no calibration".
std::string calibration_text(const std::optional<Sha256>& id);

}  // namespace nodal::firmware
