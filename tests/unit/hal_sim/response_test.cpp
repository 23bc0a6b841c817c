#include "hal/sim/scene/response.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nodal::hal::sim {
namespace {

Response curve(Response::Curve c, double gamma = 1, std::vector<double> coefficients = {}) {
  return {c, gamma, std::move(coefficients)};
}

TEST(Response, KnownValues) {
  // IEC 61966-2-1: middle grey 0.5 is 0.2140411 of the light; both pieces meet at 0.04045.
  const Response srgb = curve(Response::Curve::kSrgb);
  EXPECT_NEAR(decode(srgb, 0.5), 0.2140411, 1e-7);
  EXPECT_NEAR(encode(srgb, 0.0031308), 0.04045, 1e-5);
  EXPECT_NEAR(encode(curve(Response::Curve::kGamma, 2), 0.25), 0.5, 1e-12);
  EXPECT_NEAR(decode(curve(Response::Curve::kPolynomial, 1, {0.25, 0.75}), 0.5), 0.125 + 0.1875, 1e-12);
  EXPECT_EQ(encode(curve(Response::Curve::kLinear), 0.3), 0.3);
}

TEST(Response, EveryCurve_DecodeUndoesEncodeAndEndsStay) {
  for (const Response& response :
       {curve(Response::Curve::kLinear), curve(Response::Curve::kGamma, 2.2), curve(Response::Curve::kSrgb),
        curve(Response::Curve::kPolynomial, 1, {0.1, 0.3, 0.6})}) {
    EXPECT_NEAR(encode(response, 0), 0, 1e-9);
    EXPECT_NEAR(encode(response, 1), 1, 1e-9);
    for (int i = 0; i <= 100; ++i) EXPECT_NEAR(decode(response, encode(response, i / 100.0)), i / 100.0, 1e-9);
  }
}

TEST(Response, LightOutsideOfTheRange_Clips) {
  for (const double light : {-0.5, 1.5, 6.0}) {
    const double e = encode(curve(Response::Curve::kGamma, 2.2), light);
    EXPECT_EQ(e, light < 0 ? 0 : 1);
  }
}

}  // namespace
}  // namespace nodal::hal::sim
