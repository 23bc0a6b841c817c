// Access control: the access level of each socket, and what holds for each kind of request.
#pragma once

#include <array>
#include <cstdint>
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
  kOperate,  ///< film: takes, exposure, genlock, head settings; no calibration, no deletion, no other host's end
  kControl,  ///< everything
};

inline constexpr std::array kAccessLevels{Access::kView, Access::kOperate, Access::kControl};
/// "view-only", "operate", "control": the name of a level's socket in messages.
std::string_view socket_name(Access access);

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

class Client;
class Control;

/// A kind of request of nodal.proto. A stage carries it out as a `command`, or it is answered at once by `answer`; a
/// request with both is a command when `by_values` says so, and else a query.
struct RequestKind {
  /// Fills the reply, or leaves it empty if the reply comes later. Errors: sent to the host as the reply.
  using Answer = Status (*)(Control& control, Client& client, const wire::Request& request, wire::Reply& reply);

  wire::Request::WhatCase what = wire::Request::WHAT_NOT_SET;
  std::string_view name;             ///< the request's name in nodal.proto
  Access access = Access::kControl;  ///< the lowest right that may ask it
  const CommandKind* command = nullptr;
  Answer answer = nullptr;
  Turn turn = Turn::kNone;
  /// Whether the values in the request make it more than a query, which needs the right `more`; null: they do not
  /// matter.
  bool (*by_values)(const wire::Request& request) = nullptr;
  Access more = Access::kControl;
  bool important = false;  ///< no command, and yet it always has its own entry in the audit log before it is answered
};

/// The table of all requests (requests.cpp); a test compares it with nodal.proto.
std::span<const RequestKind> request_kinds();
/// A request that has no row, such as one of a newer host, has the last row, "unknown request"; it gets kUnsupported.
const RequestKind& kind_of(const wire::Request& request);

/// The kind of command that the request becomes; null: it is answered at once.
const CommandKind* command_kind(const wire::Request& request);
/// Whether the request changes the rig; such requests are audited.
bool changes_rig(const wire::Request& request);
/// Whether the request always has its own entry in the audit log, on the disk before it is answered.
bool is_important(const wire::Request& request);
Access access_needed(const wire::Request& request);
/// Errors: kUnsupported, naming the request and a remedy.
Status check_access(Access has, const wire::Request& request);

}  // namespace nodal::firmware
