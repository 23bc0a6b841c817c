#include "stitch/table/encoded_gain.h"

#include <algorithm>
#include <cmath>

#include "stitch/geometry/response.h"

namespace nodal::table {
namespace {

constexpr double kOctaves = 3;  // factors from 2^-3 to 2^3
constexpr int kStepsPerOctave = 16;
constexpr int kGainSteps = static_cast<int>(2 * kOctaves) * kStepsPerOctave;
constexpr int kLevels = 256;

/// The c that minimizes the sum of (c * seen - true)^2 over encoded values spread evenly.
double least_squares_gain(const std::vector<double>& light, double factor, const Response& response) {
  double across = 0;
  double along = 0;
  for (std::size_t i = 0; i < light.size(); ++i) {
    if (light[i] * factor > 1) break;
    const double seen = geometry::encode(response, light[i] * factor);
    across += seen * (static_cast<double>(i) + 0.5) / kLevels;
    along += seen * seen;
  }
  return along > 0 ? across / along : 1 / factor;
}

}  // namespace

EncodedGain::EncodedGain(const Response& response) {
  switch (response.curve) {
    case Response::Curve::kLinear: return;
    case Response::Curve::kGamma: exponent_ = -1 / response.gamma; return;
    case Response::Curve::kSrgb:
    case Response::Curve::kPolynomial: break;
  }
  std::vector<double> light(kLevels);
  for (std::size_t i = 0; i < light.size(); ++i) {
    light[i] = geometry::decode(response, (static_cast<double>(i) + 0.5) / kLevels);
  }
  for (int k = 0; k <= kGainSteps; ++k) {
    const double factor = std::exp2(static_cast<double>(k) / kStepsPerOctave - kOctaves);
    fitted_.push_back(k == kGainSteps / 2 ? 1.0 : least_squares_gain(light, factor, response));
  }
}

double EncodedGain::undo(double factor) const {
  const double f = std::clamp(factor, std::exp2(-kOctaves), std::exp2(kOctaves));
  if (f == 1) return 1;
  if (fitted_.empty()) return exponent_ == -1 ? 1 / f : std::pow(f, exponent_);
  const double at = (std::log2(f) + kOctaves) * kStepsPerOctave;
  const int k = std::clamp(static_cast<int>(at), 0, kGainSteps - 1);
  const double rest = at - k;
  return fitted_[static_cast<std::size_t>(k)] * (1 - rest) + fitted_[static_cast<std::size_t>(k) + 1] * rest;
}

}  // namespace nodal::table
