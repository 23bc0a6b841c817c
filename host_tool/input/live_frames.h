// The heads' own pictures and the calibration in force, from a running rig.
#pragma once

#include <string>

#include "host_tool/console/console.h"
#include "host_tool/input/registration_input.h"
#include "host_tool/rig/rig_connection.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

/// Errors: kUnsupported when the rig's nodald does not report the feature; `what` names the user of it.
Status require_feature(const RigConnection& rig, const std::string& feature, const std::string& what);

/// Errors: kNotFound when none is in force; those of the conversation.
Result<Calibration> calibration_in_force(RigConnection& rig);

/// `sets` frame sets, one after another, each with a picture of every head of the calibration and blended by it. The rig
/// goes on filming; each costs it one copy.
/// Errors: kDeviceGone for a head that delivers no pictures; kWrongState when another calibration came into force;
///   kOverload when the rig has no time; those of the conversation.
Result<PictureSets> pull_frame_sets(RigConnection& rig, const Calibration& calibration, int sets, Console& console);

/// Frame sets that a live registration takes: the default, and the most.
inline constexpr int kLiveSets = 3;
inline constexpr int kMostLiveSets = 64;

}  // namespace nodal::host
