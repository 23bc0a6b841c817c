// Response, fall-off and gain of a head from photographs of the pattern that are already aligned.
#pragma once

#include <array>
#include <vector>

#include "protocol/calibration.h"

namespace nodal::calibration {

/// One pixel of one photograph: its position, the pattern's light there, and the recorded value.
struct LightSample {
  int view = 0;
  double x = 0, y = 0;  ///< px
  double light = 0;     ///< light of the pattern, 0..1
  double value = 0;     ///< encoded, 0..1
};

struct Photometry {
  Response response;
  std::array<double, 3> vignetting{};  ///< coefficients over (r / radius)^2
  std::vector<double> gains;           ///< brightness of each photograph's light; the largest is 1
  double rms = 0;                      ///< rms of the residuals, encoded
};

/// value = encode(g (1 + l . light field) V(r) (light + flare)). Response and fall-off are common to all photographs;
/// the gain and a light field of four numbers (a slope, and the part of the curvature that is not rotationally
/// symmetric) belong to each. A symmetric curvature common to all photographs cannot be distinguished from the lens's
/// fall-off. A gamma curve is used unless a polynomial fits clearly better.
Photometry fit_photometry(const std::vector<LightSample>& samples, int views, const HeadCalibration& head,
                          double radius);

}  // namespace nodal::calibration
