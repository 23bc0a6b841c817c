// The lag between two heads from how fast they turn: on a rigid rig, all heads turn equally fast.
#pragma once

#include <vector>

#include "protocol/base/result.h"
#include "stitch/timing/lag.h"

namespace nodal::timing {

/// The speed of rotation of one head. From a gyro: the length of its rate. From pictures: the angle between two
/// successive frames divided by their interval, at the middle of the interval.
struct Rotation {
  std::vector<double> times{};   ///< s, by the head's clock, increasing
  std::vector<double> speeds{};  ///< rad/s
};

/// Correlates the changes of both speeds. The two may be sampled differently (a gyro at 3300 Hz, pictures at 30): both
/// are smoothed to what the slower one can show. Gaps are left out.
///
/// Errors: kBadValue if times do not increase, numbers are not finite, or counts differ; kNotDetermined, with a
/// sentence for people, if the rig is still or turns evenly, if the motion repeats, if the overlap is too short, or if
/// the lags are not on one line.
///
/// Threading: thread-safe.
Result<Lag> rotation_lag(const Rotation& a, const Rotation& b, const Search& search);

}  // namespace nodal::timing
