// All commands to the rig and their answers, in the rig's own types. Each origin of commands maps its form to these
// types: hosts (hosts/wire_commands.h), the button, and the stored settings at a start.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <tuple>
#include <variant>

#include "firmware/calibration/calibration_keeper.h"
#include "firmware/capture/capture.h"
#include "firmware/config/config.h"
#include "firmware/record/take_messages.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// One alternative for each stage that carries commands out. A stage gets a command in a request, such as
/// CaptureRequest, with a ticket by which its answer is known, such as CaptureAnswer.
using Command = std::variant<CaptureCommand, CalibrationCommand, TakeCommand>;
enum class CommandStage : std::uint8_t { kCapture, kKeeper, kTakes };

/// What holds for all commands of one type: of hosts, of the button, and of the rig itself.
struct CommandKind {
  std::string_view name;  ///< name in nodal.proto and in the audit log
  CommandStage stage = CommandStage::kCapture;
  bool changes = true;     ///< a change is audited, a query is not
  bool important = false;  ///< it always has its own entry in the audit log, which is on the disk before it is answered
};
template <class Type>
struct CommandRow {
  CommandKind kind;
};
/// The table of all commands. A type of a variant above that has no row does not compile.
inline constexpr std::tuple kCommandTable{
    CommandRow<HeadChange>{{"head_set", CommandStage::kCapture}},
    CommandRow<LeaseEnd>{{"head_set", CommandStage::kCapture}},
    CommandRow<GenlockStart>{{"genlock", CommandStage::kCapture}},
    CommandRow<GenlockStop>{{"genlock", CommandStage::kCapture}},
    CommandRow<ExposureChange>{{"exposure", CommandStage::kCapture}},
    CommandRow<CalibrationRequest::List>{{"calibration_list", CommandStage::kKeeper, false}},
    CommandRow<CalibrationRequest::Get>{{"calibration_get", CommandStage::kKeeper, false}},
    CommandRow<CalibrationRequest::Install>{{"upload_commit", CommandStage::kKeeper, true, true}},
    CommandRow<CalibrationRequest::Use>{{"calibration_use", CommandStage::kKeeper, true, true}},
    CommandRow<CalibrationRequest::Rollback>{{"calibration_rollback", CommandStage::kKeeper, true, true}},
    CommandRow<CalibrationRequest::EndTrial>{{"trial_end", CommandStage::kKeeper, true, true}},
    CommandRow<TakeRequest::Start>{{"take_start", CommandStage::kTakes}},
    CommandRow<TakeRequest::Stop>{{"take_stop", CommandStage::kTakes}},
    CommandRow<TakeRequest::Mark>{{"take_mark", CommandStage::kTakes}},
    CommandRow<TakeRequest::List>{{"take_list", CommandStage::kTakes, false}},
    CommandRow<TakeRequest::Delete>{{"take_delete", CommandStage::kTakes, true, true}},
    CommandRow<TakeRequest::Protect>{{"take_protect", CommandStage::kTakes}},
    CommandRow<TakeRequest::TestDisk>{{"disk_test", CommandStage::kTakes}},
    CommandRow<TakeRequest::Eject>{{"disk_eject", CommandStage::kTakes}},
};
template <class Type>
inline constexpr const CommandKind& kCommandKind = std::get<CommandRow<Type>>(kCommandTable).kind;
const CommandKind& kind_of(const Command& command);

/// Checks that every value is one that some rig allows. Each head then checks its own limits. Errors: kBadValue.
Status check(const Command& command, const RigConfig& config);
/// The error for a head index that the rig does not have.
Error no_such_head(std::uint64_t head, const RigConfig& config);
/// The error for a request about takes if rig.toml has no [takes].
Error no_takes();

/// The author of a command.
struct Requester {
  enum class Kind : std::uint8_t { kHost, kButton, kStoredSettings, kConfiguration, kLease };

  Kind kind = Kind::kHost;
  std::uint64_t host = 0;  ///< the host's number, for kHost
  std::string name;        ///< what the audit log calls the requester
  std::string party{};     ///< whose quota of the audit log it uses: a user at a socket; empty: `name`
  Presence presence{};     ///< the stage drops its command if it has gone before its turn
};
/// Identifies a command until its answer.
using Ticket = std::uint64_t;

struct CommandDone {
  std::optional<Instant> at;  ///< when a HeadChange was carried out; empty for other commands
};
using Outcome = std::variant<CommandDone, GenlockReport, ExposureControl::Report, CalibrationAnswer::Listed,
                             CalibrationAnswer::Document, TakeAnswer::Done, TakeAnswer::Listed, TakeAnswer::DiskTested>;
struct Answer {
  Ticket ticket = 0;
  Result<Outcome> outcome;
  std::string not_stored{};    ///< why a setting that is in effect will be lost at the next start; empty: it is stored
  std::string not_recorded{};  ///< why an important change is not in the audit log on the disk; empty: it is
};

}  // namespace nodal::firmware
