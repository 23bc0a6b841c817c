#include "stitch/table/encoded_gain.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stitch/geometry/response.h"

namespace nodal::table {
namespace {

TEST(EncodedGain, LinearResponse_IsTheInverseOfTheFactor) {
  const EncodedGain gain{Response{}};
  EXPECT_DOUBLE_EQ(gain.undo(1), 1);
  EXPECT_DOUBLE_EQ(gain.undo(0.8), 1.25);
  EXPECT_DOUBLE_EQ(gain.undo(2), 0.5);
}

TEST(EncodedGain, GammaResponse_UndoesTheFactorExactlyAtEveryLevel) {
  for (const double gamma : {0.8, 1.0, 1.8, 2.2}) {
    const Response response{Response::Curve::kGamma, gamma, {}};
    const EncodedGain gain(response);
    for (const double factor : {0.5, 0.83, 1.1}) {
      for (double light = 0.01; light * factor < 1; light += 0.07) {
        const double seen = geometry::encode(response, light * factor);
        EXPECT_NEAR(seen * gain.undo(factor), std::pow(light, 1 / gamma), 1e-12);
      }
    }
  }
}

/// The largest error of a gain in levels of 255, over all values that the change of light does not clip.
double worst_level(const Response& response, double factor, double gain) {
  double worst = 0;
  for (int level = 0; level < 256; ++level) {
    const double light = geometry::decode(response, level / 255.0);
    if (light * factor > 1) break;
    worst = std::max(worst, std::abs(255 * geometry::encode(response, light * factor) * gain - level));
  }
  return worst;
}

TEST(EncodedGain, SrgbResponse_IsWithinTwoLevelsWhereAPlainInverseIsOffByTens) {
  const Response srgb{Response::Curve::kSrgb, 1, {}};
  const EncodedGain gain(srgb);
  EXPECT_EQ(gain.undo(1), 1);
  for (const double factor : {0.7, 0.85, 1.15, 1.4}) {
    EXPECT_LT(worst_level(srgb, factor, gain.undo(factor)), 3.2) << factor;
    EXPECT_GT(worst_level(srgb, factor, 1 / factor), 10) << factor;
    // A gain 1 % larger or smaller gives a larger sum of squares: the definition of least squares.
    const auto squares = [&](double c) {
      double sum = 0;
      for (int i = 0; i < 4096; ++i) {
        const double level = (i + 0.5) / 4096;
        const double light = geometry::decode(srgb, level);
        if (light * factor > 1) break;
        sum += std::pow(c * geometry::encode(srgb, light * factor) - level, 2);
      }
      return sum;
    };
    EXPECT_LT(squares(gain.undo(factor)), squares(gain.undo(factor) * 1.01)) << factor;
    EXPECT_LT(squares(gain.undo(factor)), squares(gain.undo(factor) * 0.99)) << factor;
  }
}

TEST(EncodedGain, PolynomialThatIsAPower_IsNearThatPower) {
  const Response square{Response::Curve::kPolynomial, 1, {0.0001, 0.9999}};  // light = encoded^2, almost
  const EncodedGain gain(square);
  EXPECT_NEAR(gain.undo(0.64), 1 / 0.8, 1e-3);
  EXPECT_NEAR(gain.undo(1.44), 1 / 1.2, 1e-3);
}

TEST(EncodedGain, FactorsBeyondThreeStops_AreTakenAsThreeStops) {
  const EncodedGain gain{Response{}};
  EXPECT_DOUBLE_EQ(gain.undo(0), 8);
  EXPECT_DOUBLE_EQ(gain.undo(1e9), 0.125);
}

}  // namespace
}  // namespace nodal::table
