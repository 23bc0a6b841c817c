#include "stitch/geometry/response.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <cmath>

#include "examples.h"

namespace nodal::geometry {
namespace {

const std::vector<Response> kEvery{
    {Response::Curve::kLinear, 1, {}},
    {Response::Curve::kGamma, 2.2, {}},
    {Response::Curve::kSrgb, 1, {}},
    {Response::Curve::kPolynomial, 1, {0.2, 0.1, 0.7}},
};

RC_GTEST_PROP(Response, DecodeOfEncode_IsTheLight, ()) {
  for (const Response& response : kEvery) {
    const double light = between(0, 1);
    const double back = decode(response, encode(response, light));
    // sRGB's published constants leave a step of 3e-8 where its two pieces meet.
    RC_ASSERT(std::abs(back - light) <= 1e-7);
  }
}

TEST(Response, EndsStayEnds_AndOutsideIsClamped) {
  for (const Response& response : kEvery) {
    EXPECT_NEAR(decode(response, 0), 0, 1e-15);
    EXPECT_NEAR(decode(response, 1), 1, 1e-12);
    EXPECT_NEAR(encode(response, -3), 0, 1e-15);
    EXPECT_NEAR(encode(response, 7), 1, 1e-12);
  }
}

TEST(Response, KnownValues) {
  EXPECT_NEAR(decode(kEvery[1], 0.5), std::pow(0.5, 2.2), 1e-15);
  // IEC 61966-2-1: an encoded 0.5 is 21.4 % of the light.
  EXPECT_NEAR(decode(kEvery[2], 0.5), 0.21404114, 1e-8);
  EXPECT_NEAR(decode(kEvery[3], 0.5), 0.2 * 0.5 + 0.1 * 0.25 + 0.7 * 0.125, 1e-15);
}

}  // namespace
}  // namespace nodal::geometry
