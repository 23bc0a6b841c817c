#include "hal/sim/scene/response.h"

#include <algorithm>
#include <cmath>

namespace nodal::hal::sim {

double decode(const Response& response, double encoded) {
  const double e = std::clamp(encoded, 0.0, 1.0);
  switch (response.curve) {
    case Response::Curve::kLinear: return e;
    case Response::Curve::kGamma: return std::pow(e, response.gamma);
    case Response::Curve::kSrgb:  // IEC 61966-2-1
      return e <= 0.04045 ? e / 12.92 : std::pow((e + 0.055) / 1.055, 2.4);
    case Response::Curve::kPolynomial: {
      double light = 0;
      for (std::size_t i = response.coefficients.size(); i > 0; --i) light = (light + response.coefficients[i - 1]) * e;
      return light;
    }
  }
  return e;
}

double encode(const Response& response, double light) {
  const double l = std::clamp(light, 0.0, 1.0);
  switch (response.curve) {
    case Response::Curve::kLinear: return l;
    case Response::Curve::kGamma: return std::pow(l, 1.0 / response.gamma);
    case Response::Curve::kSrgb: return l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055;
    case Response::Curve::kPolynomial: {
      double low = 0;
      double high = 1;
      for (int k = 0; k < 52; ++k) {
        const double middle = 0.5 * (low + high);
        (decode(response, middle) < l ? low : high) = middle;
      }
      return 0.5 * (low + high);
    }
  }
  return l;
}

}  // namespace nodal::hal::sim
