// What the estimators assume of clocks and timestamps: the specification they are computed from.
#pragma once

#include "protocol/base/units.h"

namespace nodal::firmware::clock_spec {

/// A timestamp of an exposure is wrong by up to this, every value as likely, independent of the one before. An exposure
/// that itself begins early or late by as much looks the same.
inline constexpr double kTimestampErrorUs = 200;
/// Variance of a uniform error of +-e is e^2 / 3: a standard deviation of 115 us.
inline constexpr double kTimestampVarianceUs2 = kTimestampErrorUs * kTimestampErrorUs / 3;
/// A timestamp that the driver takes when the exposure begins, without any of the above.
inline constexpr Duration kDriverTimestampError = Duration::microseconds(20);

/// A crystal is off by up to 50 ppm, every value as likely. 1 ppm is 1 us/s.
inline constexpr double kCrystalErrorPpm = 50;
/// Of the difference of two crystals: the variances add. A standard deviation of 41 ppm.
inline constexpr double kDriftVariancePpm2 = 2 * kCrystalErrorPpm * kCrystalErrorPpm / 3;
/// A head that loses its trigger, or finds it again, has another drift from then on. The model spreads that change over
/// this time: the drift is a random walk that gains one variance of a drift in it.
inline constexpr double kDriftChangesInS = 10;
inline constexpr double kDriftNoisePpm2PerS = kDriftVariancePpm2 / kDriftChangesInS;
/// A crystal by itself changes its drift by 1 ppm in a minute, as a case warms up.
inline constexpr double kWanderPpm2PerS = 1.0 / 60;
/// The longest time from one set to the next, at 5 sets a second, in which two crystals part by 20 us.
inline constexpr Duration kCreepPerSet = Duration::microseconds(20);

}  // namespace nodal::firmware::clock_spec
