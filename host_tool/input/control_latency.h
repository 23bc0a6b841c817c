// Measures how many frames of a head pass from a change of its exposure to the first frame with it.
#pragma once

#include <algorithm>
#include <climits>
#include <cstdint>
#include <functional>
#include <optional>

#include "host_tool/rig/rig_connection.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// Bounds of a latency, from samples of frames; 0 is the first frame that begins after the request.
class LatencyBounds {
 public:
  /// This frame still has the old exposure, or has the new one already.
  void has_old(int frame) { low_ = std::max(low_, frame + 1); }
  void has_new(int frame) { high_ = std::min(high_, frame); }
  /// The first frame with the new exposure is at least low() and at most high(). After contradictory samples low() is
  /// above high(): the latency varied between high() and low().
  int low() const { return low_; }
  int high() const { return high_; }
  bool exact() const { return low_ == high_; }

 private:
  int low_ = 0;
  int high_ = INT_MAX;
};

struct ControlLatency {
  LatencyBounds seen;    ///< by the brightness of pictures
  LatencyBounds stated;  ///< by the exposure that the rig states for each frame, from the head's configured latency
  std::uint64_t exposure_ns = 0, stepped_ns = 0;  ///< before and after a step
  double brightness = 0, stepped_brightness = 0;
  int steps = 0;
};

inline constexpr int kLatencySteps = 24;       ///< at most
inline constexpr int kFewestLatencySteps = 4;  ///< so that a latency that varies is noticed
inline constexpr int kLongestLatency = 30;     ///< frames
inline constexpr double kMinLevels = 4;        ///< levels of 255 by which the picture must change

/// Halves and restores the exposure of a head repeatedly (doubles it, when it cannot be halved). The changes are
/// temporary: the rig undoes them when the conversation ends, however this program ends. `progress`: called with the
/// number of steps.
/// Errors: kUnsupported for a head whose exposure cannot be changed, or a rig that does not say when it changed;
/// kWrongState if its picture does not change enough; kTimeout if nothing changes within kLongestLatency; those of the
/// rig.
Result<ControlLatency> measure_control_latency(RigConnection& rig, const wire::HeadState& head,
                                               const std::function<void(int)>& progress);

}  // namespace nodal::host
