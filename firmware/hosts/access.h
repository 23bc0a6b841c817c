// What a host may ask: by the socket it came in at, and one table of what every request needs.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "hal/link.h"
#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::firmware {

/// Each level includes those before it.
enum class Access : std::uint8_t {
  kView,     ///< see how the rig is and what it sees, without an effect on anybody else
  kControl,  ///< everything
};

/// Where hosts connect, and what they may ask there.
struct Listener {
  hal::LinkListenerPort* port = nullptr;
  Access access = Access::kControl;
};

/// Whether carrying it out changes the rig; what the audit log is about.
bool changes_rig(const wire::Request& request);
/// Whether the keeper of calibrations carries it out.
bool needs_keeper(const wire::Request& request);
/// The table. Its switch names every request, so that one without a line does not compile.
Access access_needed(const wire::Request& request);
/// "genlock", "upload_commit": as nodal.proto names the request.
std::string_view request_name(const wire::Request& request);
/// Errors: kUnsupported, which names the request and says what to do.
Status check_access(Access has, const wire::Request& request);

}  // namespace nodal::firmware
