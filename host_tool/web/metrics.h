// The rig's state in the text format of Prometheus.
#pragma once

#include <string>

#include "host_tool/web/rig_desk.h"

namespace nodal::host::web {

/// Series of one answer at most, whatever a rig names: a rig of 16 heads with every reason of a loss has fewer.
inline constexpr std::size_t kMaxSeries = 400;

/// All of one moment, so that in every answer nodal_frames_taken_total is the sum of nodal_frames_in_sets_total, of all
/// nodal_frames_lost_total and of nodal_frames_held. No series names a viewer.
std::string metrics_text(const RigDesk::State& state);
/// When the rig does not answer.
std::string metrics_without_rig();

}  // namespace nodal::host::web
