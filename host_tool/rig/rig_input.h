// Checks of a rig's messages before a command uses them. A rig may be broken or hostile: every list has a limit, and
// every text is made printable.
#pragma once

#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/nodal.pb.h"

namespace nodal::host {

inline constexpr int kMaxCounts = 64;     ///< entries in a list of losses by reason, or of drops by client
inline constexpr int kMaxMarks = 256;     ///< a rig keeps the last 32
inline constexpr int kMaxSentences = 64;  ///< entries in a list of problems
inline constexpr int kMaxCalibrations = 1024;
inline constexpr int kMaxTakes = 1000;
inline constexpr int kMaxDiskModes = 8;
inline constexpr int kMaxAuditEntries = 1024;  ///< a rig keeps the newest 256
inline constexpr int kMaxHosts = 256;          ///< a rig talks to 8
inline constexpr int kMaxDeviceLines = 4096;   ///< of the list of what is plugged in
inline constexpr std::size_t kMaxNameBytes = 200;
inline constexpr std::size_t kMaxSentenceBytes = 1000;

/// Makes texts printable (protocol/base/text.h) and shortens them to the limits above.
/// Errors: kTooLarge for a list over its limit, kBadFormat for an id that is not a SHA-256.
Status check_and_clean(wire::Hello& hello);
Status check_and_clean(wire::Reply& reply);
Status check_and_clean(wire::RaymapHeader& header);
Status check_and_clean(wire::FrameSetHeader& header);

}  // namespace nodal::host
