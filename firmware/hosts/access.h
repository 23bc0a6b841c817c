// Access control: the access level of each socket, and one table of the level that each request needs.
#pragma once

#include <cstdint>
#include <optional>
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

/// Whether the request changes the rig; such requests are audited.
bool changes_rig(const wire::Request& request);
/// The stage with a disk that carries the request out, if one does.
std::optional<CommandStage> slow_stage(const wire::Request& request);
/// The table. Its switch names every request, so that a request without a line does not compile.
Access access_needed(const wire::Request& request);
/// "genlock", "upload_commit": the name in nodal.proto.
std::string_view request_name(const wire::Request& request);
/// Errors: kUnsupported, naming the request and a remedy.
Status check_access(Access has, const wire::Request& request);

}  // namespace nodal::firmware
