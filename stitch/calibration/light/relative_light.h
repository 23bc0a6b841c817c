// How much brighter each head records the same light than the others at one moment.
#pragma once

#include <vector>

#include "protocol/calibration.h"
#include "stitch/calibration/light/light_samples.h"
#include "stitch/geometry/head.h"

namespace nodal::calibration {

struct RelativeLight {
  std::vector<double> stops;  ///< by head, from the mean of the heads that shared rays connect; 0 where not known
  std::vector<double> sigma;  ///< standard deviations; above kUnknownLight for a head that shares too few rays
};
inline constexpr double kUnknownLight = 1;  ///< stops

/// Compares the first channel of the pictures. Responses, gains and fall-offs are those of the calibration that the
/// heads were made of. Errors: none; `set` is as for calibrate_light().
RelativeLight relative_light(const Calibration& calibration, const std::vector<geometry::Head>& heads,
                             const ExposedSet& set);

}  // namespace nodal::calibration
