// Response, fall-off and gain of a head from photographs of the pattern that are aligned already.
#pragma once

#include <array>
#include <vector>

#include "protocol/calibration.h"

namespace nodal::calibration {

/// One pixel of one photograph: its place, the pattern's light there, and the recorded value.
struct LightSample {
  int view = 0;
  double x = 0, y = 0;  ///< px
  double light = 0;     ///< of the pattern, 0..1
  double value = 0;     ///< encoded, 0..1
};

struct Photometry {
  Response response;
  std::array<double, 3> vignetting{};  ///< over (r / radius)^2
  std::vector<double> gains;           ///< of each photograph's light, the largest 1
  double rms = 0;                      ///< what is left, encoded
};

/// value = encode(g (1 + l . light field) V(r) (light + flare)): response and fall-off are common to the
/// photographs; gain and a light field of four numbers (a slope, and the part of a bend that is not round)
/// belong to each. A bend of the light that is round and the same in all photographs cannot be told from the
/// lens's fall-off. A gamma curve is taken unless a polynomial explains clearly more.
Photometry fit_photometry(const std::vector<LightSample>& samples, int views, const HeadCalibration& head,
                          double radius);

}  // namespace nodal::calibration
