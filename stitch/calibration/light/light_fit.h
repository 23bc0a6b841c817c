// Least squares on logarithms of light: all observations of one light must decode to the same value.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "protocol/calibration.h"
#include "stitch/calibration/light/light_samples.h"

namespace nodal::calibration {

/// The radiometry of the heads: ln light = ln decode(value) - log_gain - ln V(s), V = 1 + v1 s + v2 s^2 + v3 s^3.
struct LightModel {
  std::vector<Response> response;
  std::vector<std::array<double, 3>> log_gain;    ///< red, green, blue
  std::vector<std::array<double, 3>> vignetting;  ///< equal for all heads if shared
};

/// The radiometry that a calibration says.
LightModel model_of(const Calibration& calibration);
/// ln of the light that an observation is of.
double log_light(const LightModel& model, const Observation& observation);

/// The spread of observations of one light under a model, natural logarithms.
struct Disagreement {
  double rms = 0;                ///< weighted
  std::vector<double> head_rms;  ///< rms of each head's observations
};
Disagreement disagreement(const LightGroups& groups, const LightModel& model);

/// A curve that fits how values change with the known exposures: a gamma curve unless a polynomial fits clearly
/// better.
struct ResponseFit {
  Response response;
  double sigma_gamma = 0;  ///< standard deviation; 0 for a polynomial
  double rms = 0;          ///< rms of the residuals, natural logarithms
};
ResponseFit fit_response(const LightGroups& same_places);

/// Fits gains and fall-off of the heads that `placed` marks, with their responses held. The mean of their log gains is
/// kept. Other heads are left out; `shared_rays` must hold none of their observations.
struct LightFreedom {
  std::vector<bool> placed;
  bool own_vignetting = false;
};
struct LightFit {
  LightModel model;
  std::vector<std::array<double, 3>> sigma_log_gain;  ///< standard deviations of each head's log gains
  std::vector<double> sigma_corner;                   ///< standard deviation of each head's ln V at s = 1
};
LightFit fit_gains(const LightGroups& shared_rays, const LightModel& start, const LightFreedom& freedom);

}  // namespace nodal::calibration
