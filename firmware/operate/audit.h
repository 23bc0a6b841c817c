// What the audit log says of a change: its values before and after, and the entry as one line of text.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "firmware/operate/commands.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// One change, or several of the same kind that are merged.
struct AuditEntry {
  std::uint64_t number = 0;      ///< over all starts, from 1; 0: not numbered yet
  std::optional<Instant> at;     ///< when it was recorded; empty: in an earlier run of nodald
  std::int64_t utc_ns = 0;       ///< the same by the board's clock, since 1970; 0: unknown
  std::int64_t last_utc_ns = 0;  ///< time of the newest merged change by the board's clock, ns since 1970; 0: unknown
  std::uint64_t count = 1;       ///< number of merged changes
  std::string who;               ///< "user 1000, process 4711, host 3 at unix:...", "button", "stored settings"
  std::string what;              ///< CommandKind::name
  std::string before;            ///< the values that the command changes, before it; before the first, if merged
  std::string after;             ///< the requested values; of a calibration, the one in force; of the newest, if merged
  std::optional<Error> error;    ///< empty: the command succeeded
};

inline constexpr std::size_t kMaxAuditText = 240;  ///< bytes of each text of an entry

/// The entry as one line for the audit file, and back. The number and `at` are not in it. Nothing: the line is none.
std::string to_line(const AuditEntry& entry);
std::optional<AuditEntry> audit_entry_of(std::string_view line);

/// The present values of what a command changes; only those that the command names.
std::string values_before(const Command& command, const CaptureReport& capture, const KeeperReport& keeper);
/// The values that a command requests. For a command about calibrations: `in_force`, the one in force after it.
std::string values_after(const Command& command, const RigConfig& config, const std::optional<Sha256>& in_force);
/// "calibration 0123456789ab", "no calibration".
std::string calibration_text(const std::optional<Sha256>& id);

}  // namespace nodal::firmware
