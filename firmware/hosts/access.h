// Access control: the access level of each socket, and one table of what holds for each kind of request.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "firmware/operate/commands.h"
#include "hal/link.h"
#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::firmware {

/// Each level includes those before it.
enum class Access : std::uint8_t {
  kView,     ///< read the rig's state and its pictures, without an effect on other hosts
  kControl,  ///< everything
};

/// A socket that hosts connect to, and their access level.
struct Listener {
  hal::LinkListenerPort* port = nullptr;
  Access access = Access::kControl;
};

/// What a request shares with requests of other hosts, and waits for.
enum class Turn : std::uint8_t {
  kNone,          ///< answered at once, whatever other hosts do
  kFrameSets,     ///< memory for copies: FrameSender
  kTakeReads,     ///< the disk of the takes, piece by piece: TakeSender
  kCalibrations,  ///< the keeper, which installs one calibration at a time: Control
  kDiskTest,      ///< one test answers all who wait: TakeKeeper
};

/// What holds for a kind of request, or depends on the values in it.
enum class Holds : std::uint8_t { kNever, kAlways, kByValues };

/// A kind of request of nodal.proto.
struct RequestKind {
  wire::Request::WhatCase what = wire::Request::WHAT_NOT_SET;
  std::string_view name;                     ///< the request's name in nodal.proto
  Access access = Access::kControl;          ///< the lowest right that may ask it
  Holds control = Holds::kNever;             ///< whether its values can make it need control although `access` is view
  Holds changes = Holds::kNever;             ///< whether it changes the rig; such requests are audited
  std::optional<CommandStage> slow_stage{};  ///< the stage with a disk that carries it out, if one does
  Turn turn = Turn::kNone;
  bool important = false;  ///< it always has its own entry in the audit log, on the disk before it is answered
};

/// All of them; a test compares the table with nodal.proto.
std::span<const RequestKind> request_kinds();
/// A request of a newer host has the last row, "unknown request"; it gets kUnsupported.
const RequestKind& kind_of(const wire::Request& request);

/// Whether the request changes the rig; such requests are audited.
bool changes_rig(const wire::Request& request);
Access access_needed(const wire::Request& request);
/// Errors: kUnsupported, naming the request and a remedy.
Status check_access(Access has, const wire::Request& request);

}  // namespace nodal::firmware
