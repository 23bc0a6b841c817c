// The lag between two heads whose cameras have separate clocks, as a straight line in time.
#pragma once

#include <cmath>

namespace nodal::timing {

/// What happens at time t of head a is in head b's film at t + lag(t). Times are seconds of each film's own clock.
struct Lag {
  double at = 0;    ///< time of a at which `lag` holds, s
  double lag = 0;   ///< s
  double rate = 0;  ///< change of the lag with time, s/s: 1e-6 is 1 ppm
  double lag_variance = 0;
  double rate_variance = 0;
  double covariance = 0;  ///< covariance of lag and rate
  int measured = 0;       ///< chunks or events that were tried
  int used = 0;           ///< those on the line
  double scatter = 0;     ///< standard deviation of the used ones from the line, s

  double value(double time) const { return lag + rate * (time - at); }
  double variance(double time) const {
    const double s = time - at;
    return lag_variance + 2 * s * covariance + s * s * rate_variance;
  }
  double sigma(double time) const { return std::sqrt(variance(time)); }
};

/// Where a lag is searched: `expected` - `reach` .. `expected` + `reach`.
struct Search {
  double expected = 0;  ///< s, from the films' own times; 0 if they say nothing
  double reach = 7;     ///< s
};

/// Clocks of cameras differ by 1 to 145 ppm (measurements that were published); more is taken for an error.
inline constexpr double kRateBound = 300e-6;

}  // namespace nodal::timing
