// Weights for interpolation between samples.
#pragma once

#include <array>

namespace nodal::bands {

/// Catmull and Rom's cubic ("A class of local interpolating splines", 1974): weights of the four samples around a
/// position, `t` from the second one towards the third, 0 .. 1. They sum to 1.
inline std::array<float, 4> cubic_weights(double t) {
  const double a = t * t, b = a * t;
  return {static_cast<float>((-b + 2 * a - t) / 2), static_cast<float>((3 * b - 5 * a + 2) / 2),
          static_cast<float>((-3 * b + 4 * a + t) / 2), static_cast<float>((b - a) / 2)};
}

/// A quadratic B-spline: weights of the three samples around a position, `t` from the middle one, -1/2 .. 1/2. It
/// smooths.
inline std::array<float, 3> spline_weights(double t) {
  const double a = 0.5 - t, b = 0.5 + t;
  return {static_cast<float>(a * a / 2), static_cast<float>(0.75 - t * t), static_cast<float>(b * b / 2)};
}

}  // namespace nodal::bands
