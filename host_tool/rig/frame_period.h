// The rig's frame period, for deadlines that mean "some frames".
#pragma once

#include "host_tool/rig/rig_connection.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// Period of the frame rate in force. Errors: kBadFormat for a rate that no rig can have; those of the connection.
Result<Duration> frame_period(RigConnection& rig);

/// The longest wait for something that the rig makes from the next frame sets: its own deadlines are shorter.
Result<Duration> patience_for_sets(RigConnection& rig);

}  // namespace nodal::host
