// Gets the heads' own pictures and the calibration in force from a running rig.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host_tool/console/console.h"
#include "host_tool/input/rig_pictures.h"
#include "host_tool/rig/rig_connection.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::host {

/// Errors: kUnsupported if the rig's nodald does not report the feature; `what` names the command that needs it.
Status require_feature(const RigConnection& rig, const std::string& feature, const std::string& what);

/// Errors: kNotFound if none is in force; those of the connection.
Result<Calibration> calibration_in_force(RigConnection& rig);

/// Pulls `sets` frame sets, one after another, each with a picture of every head of the calibration and blended with
/// it. The rig continues to film; each set costs it one copy.
/// Sets that lack a head are passed over.
/// Errors: kDeviceGone for a head that delivers no pictures; kOverload if no set has all heads, or if the rig has no
/// time; kWrongState if another calibration came into force; those of the connection.
Result<RigPictures> pull_frame_sets(RigConnection& rig, const Calibration& calibration, int sets, Console& console);

/// One frame set of a rig without a calibration, for calibrate_by_pictures().
/// Errors: the same; kWrongState if a calibration is in force; kUnsupported as require_feature().
Result<RigPictures> pull_uncalibrated_set(RigConnection& rig, const std::string& what, Console& console);

/// The same as the first with the calibration in force. `what`: the command, for require_feature().
Result<RigPictures> pull_frame_sets(RigConnection& rig, const std::string& what, int sets, Console& console);

/// One frame of a head.
struct HeadSample {
  std::uint64_t mid_exposure_ns = 0;  ///< mid-exposure of its set
  std::uint64_t exposure_ns = 0;      ///< exposure in effect, as the rig states it
  double brightness = 0;              ///< mean of its luma, grey, or R, G and B samples
};
/// The head's frame of the next set; nothing if the set has none. `within`: patience_for_sets(). Errors: those of the
/// connection.
Result<std::optional<HeadSample>> sample_head(RigConnection& rig, std::uint32_t head, Duration within);

/// The number of frame sets that a live registration uses: default and maximum.
inline constexpr int kLiveSets = 3;
inline constexpr int kMaxLiveSets = 64;

}  // namespace nodal::host
