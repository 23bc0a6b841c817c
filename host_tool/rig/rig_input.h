// Checks of a rig's messages before a command uses them. A rig may be broken or hostile: every list has a limit, and
// every text is made printable.
#pragma once

#include <string>
#include <string_view>

#include "protocol/base/result.h"
#include "protocol/base/try.h"
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
inline constexpr int kMaxDeviceLines = 4096;   ///< lines about devices that are plugged in
inline constexpr std::size_t kMaxNameBytes = 200;
inline constexpr std::size_t kMaxSentenceBytes = 1000;

/// The only way from bytes of a rig to a message: parses, checks and cleans. So no command sees a text that was not
/// made printable. `what` names the message in errors.
/// Errors: kBadFormat for bytes that are no such message; those of check_and_clean().
template <class Message>
Result<Message> parse_clean(const std::string& bytes, std::string_view what);

/// Makes texts printable (protocol/base/text.h) and shortens them to the limits above.
/// Errors: kTooLarge for a list over its limit, kBadFormat for an id that is not a SHA-256.
Status check_and_clean(wire::Hello& hello);
Status check_and_clean(wire::Reply& reply);
Status check_and_clean(wire::RaymapHeader& header);
Status check_and_clean(wire::FrameSetHeader& header);
Status check_and_clean(wire::TakePiece& piece);

template <class Message>
Result<Message> parse_clean(const std::string& bytes, std::string_view what) {
  Message message;
  if (!message.ParseFromString(bytes)) return fail(Errc::kBadFormat, "the rig sent invalid " + std::string(what));
  NODAL_TRY(check_and_clean(message));
  return message;
}

}  // namespace nodal::host
