// Pi and the conversion between degrees and radians.
#pragma once

#include <numbers>

namespace nodal {

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kRadiansPerDegree = kPi / 180;
inline constexpr double kDegreesPerRadian = 180 / kPi;

}  // namespace nodal
