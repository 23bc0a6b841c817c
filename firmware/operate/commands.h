// What can be asked of the rig, in the rig's own types, and what comes back. Each face maps its own form to these: hosts
// (hosts/wire_commands.h), the button, and the settings of the last start.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

#include "firmware/calibration/calibration_keeper.h"
#include "firmware/capture/capture.h"
#include "firmware/config/config.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// One alternative for each stage that carries commands out.
using Command = std::variant<CaptureChange, CalibrationCommand>;
enum class CommandStage : std::uint8_t { kCapture, kKeeper };
CommandStage stage_of(const Command& command);

/// "head_set", "calibration_use": as the audit log and nodal.proto have it.
std::string_view command_name(const Command& command);
/// Whether it is a change, which the audit log keeps; the others are questions.
bool changes_rig(const Command& command);
/// Whether every value is one that a rig may be asked for. What a head can do of it, the head says. Errors: kBadValue.
Status check(const Command& command, const RigConfig& config);
/// The error for a head that there is not.
Error no_such_head(std::uint64_t head, const RigConfig& config);

/// Who asks.
struct Asker {
  enum class Face : std::uint8_t { kHost, kButton, kLastStart };

  Face face = Face::kHost;
  std::uint64_t host = 0;  ///< its number, of a kHost
  std::string name;        ///< for the audit log
};
/// Names a command until its answer.
using Ticket = std::uint64_t;

struct CommandDone {};
using Outcome =
    std::variant<CommandDone, GenlockReport, ExposureControl::Report, KeeperAnswer::Listed, KeeperAnswer::Document>;
struct Answer {
  Ticket ticket = 0;
  Result<Outcome> outcome;
  std::string not_stored{};  ///< why a setting that is in effect would be lost at the next start; else empty
};

}  // namespace nodal::firmware
