// The specification of clocks and timestamps from which the estimators are computed.
#pragma once

#include "protocol/base/units.h"

namespace nodal::firmware::clock_spec {

/// The largest error of an exposure's timestamp. Errors are uniformly distributed and independent. An exposure that
/// itself begins early or late has the same effect.
inline constexpr double kTimestampErrorUs = 200;
/// Variance of a uniform error of +-e is e^2 / 3: a standard deviation of 115 us.
inline constexpr double kTimestampVarianceUs2 = kTimestampErrorUs * kTimestampErrorUs / 3;
/// The error of a timestamp that the driver takes when the exposure begins.
inline constexpr Duration kDriverTimestampError = Duration::microseconds(20);

/// The largest error of a crystal, uniformly distributed. 1 ppm is 1 us/s.
inline constexpr double kCrystalErrorPpm = 50;
/// Variance of the difference of two crystals, the sum of their variances: a standard deviation of 41 ppm.
inline constexpr double kDriftVariancePpm2 = 2 * kCrystalErrorPpm * kCrystalErrorPpm / 3;
/// The drift of a head changes when it loses its trigger, or receives it again. The model spreads this change over this
/// time: the drift is a random walk whose variance grows by kDriftVariancePpm2 in it.
inline constexpr double kDriftChangesInS = 10;
inline constexpr double kDriftNoisePpm2PerS = kDriftVariancePpm2 / kDriftChangesInS;
/// Random walk of a crystal whose temperature changes: 1 ppm in a minute.
inline constexpr double kWanderPpm2PerS = 1.0 / 60;
/// How far two crystals move apart between two sets at the lowest rate, 5 sets per second.
inline constexpr Duration kCreepPerSet = Duration::microseconds(20);

}  // namespace nodal::firmware::clock_spec
