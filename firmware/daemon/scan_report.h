// The result of a scan for people, whose comments and rig.toml are one TOML document, and for programs.
#pragma once

#include <string>
#include <vector>

#include "firmware/daemon/rig_proposal.h"
#include "hal/linux/v4l2/scan.h"
#include "protocol/base/result.h"

namespace nodal::daemon {

/// Devices, buses and reasons as comments, then the proposed rig.toml. A proposal with heads is read back as nodald
/// reads a rig.toml. Errors: those of parse_rig_config().
Result<std::string> scan_text(const std::vector<hal::v4l2::FoundDevice>& devices, const RigPlaces& places = {});

/// The same as JSON, complete: the text cuts long lists. nodald(8) explains the fields. Errors: the same.
Result<std::string> scan_json(const std::vector<hal::v4l2::FoundDevice>& devices, const RigPlaces& places = {});

}  // namespace nodal::daemon
