// A straight line through lags that were measured at several times, some of which are wrong.
#pragma once

#include <optional>
#include <span>

#include "stitch/timing/lag.h"

namespace nodal::timing {

/// One measured lag.
struct LagPoint {
  double at = 0;   ///< time of head a, s
  double lag = 0;  ///< s
};

struct LineOptions {
  double tolerance = 0;        ///< largest distance from the line of a lag that is right, s
  double least_scatter = 0;    ///< standard deviation of one lag, s, even if the lags are closer to the line
  double rate_sigma = 100e-6;  ///< standard deviation of the rate before anything is measured, s/s
};

/// The line that most lags are close to (RANSAC over all pairs of lags, or over 4000 of them), then fitted by least
/// squares to those. Nothing if fewer than three lags are on a line. The variances are from the scatter of the lags,
/// enlarged where there are few.
std::optional<Lag> robust_line(std::span<const LagPoint> points, const LineOptions& options);

}  // namespace nodal::timing
