#include "stitch/geometry/response.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/polynomial.h"
#include "stitch/geometry/lens/rising_polynomial.h"

namespace nodal::geometry {

double decode(const Response& response, double encoded) {
  const double e = std::clamp(encoded, 0.0, 1.0);
  switch (response.curve) {
    case Response::Curve::kLinear: return e;
    case Response::Curve::kGamma: return std::pow(e, response.gamma);
    case Response::Curve::kSrgb: return e <= 0.04045 ? e / 12.92 : std::pow((e + 0.055) / 1.055, 2.4);
    case Response::Curve::kPolynomial: return std::clamp(e * polynomial_value(response.coefficients, e), 0.0, 1.0);
  }
  return e;
}

double encode(const Response& response, double light) {
  const double l = std::clamp(light, 0.0, 1.0);
  switch (response.curve) {
    case Response::Curve::kLinear: return l;
    case Response::Curve::kGamma: return std::pow(l, 1 / response.gamma);
    case Response::Curve::kSrgb: return l <= 0.0031308 ? l * 12.92 : 1.055 * std::pow(l, 1 / 2.4) - 0.055;
    case Response::Curve::kPolynomial: return RisingPolynomial(response.coefficients, 1.0).inverse(l).value_or(1.0);
  }
  return l;
}

}  // namespace nodal::geometry
