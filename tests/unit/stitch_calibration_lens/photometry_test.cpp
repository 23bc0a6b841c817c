#include "stitch/calibration/lens/photometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace nodal::calibration {
namespace {

HeadCalibration head() {
  HeadCalibration h;
  h.width = 720;
  h.height = 480;
  h.center_x = 361;
  h.center_y = 225;
  return h;
}

struct Photographs {
  double v1 = -0.3, v2 = 0.05;
  double flare = 0.03;
  std::vector<double> gains{0.9, 0.55, 0.7};
  double slope = 0.2;
};

/// Samples from a sensor with this encoding.
template <class Encode>
std::vector<LightSample> samples(const Photographs& photographs, double radius, Encode encode) {
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> any(0, 1);
  std::normal_distribution<double> noise(0, 0.008);
  std::vector<LightSample> all;
  for (int view = 0; view < 3; ++view) {
    for (int n = 0; n < 6000; ++n) {
      LightSample s{view, 720 * any(engine), 480 * any(engine), any(engine), 0};
      const double r2 = (std::pow(s.x - 361, 2) + std::pow(s.y - 225, 2)) / (radius * radius);
      const double slant = 1 + photographs.slope * (s.x / 360 - 1) * (view - 1);
      const double lamp = photographs.gains[static_cast<std::size_t>(view)] * slant;
      s.value = encode(lamp * (1 + photographs.v1 * r2 + photographs.v2 * r2 * r2) * (s.light + photographs.flare)) +
                noise(engine);
      all.push_back(s);
    }
  }
  return all;
}

double fall_off(const std::array<double, 3>& v, double s) { return 1 + s * (v[0] + s * (v[1] + s * v[2])); }

TEST(FitPhotometry, GammaCurveUnderSlantingLight_IsFoundWithItsFallOffAndGains) {
  const Photographs photographs;
  const double radius = std::hypot(360, 240);
  const auto photometry =
      fit_photometry(samples(photographs, radius, [](double l) { return std::pow(l, 1 / 2.2); }), 3, head(), radius);
  ASSERT_EQ(photometry.response.curve, Response::Curve::kGamma);
  EXPECT_NEAR(photometry.response.gamma, 2.2, 0.02);
  for (const double s : {0.25, 0.5, 1.0}) {
    EXPECT_NEAR(fall_off(photometry.vignetting, s), 1 - 0.3 * s + 0.05 * s * s, 0.01);
  }
  EXPECT_NEAR(photometry.gains[0], 1, 1e-12);
  EXPECT_NEAR(photometry.gains[1], 0.55 / 0.9, 0.01);
  EXPECT_NEAR(photometry.gains[2], 0.7 / 0.9, 0.01);
}

TEST(FitPhotometry, CurveThatIsNoGamma_IsFittedByAPolynomial) {
  // light = 1.6 e - 2.2 e^2 + 1.6 e^3, steep, flat, steep: no gamma curve is close to it.
  const auto encode = [](double light) {
    double low = 0, high = 1.5;
    for (int n = 0; n < 50; ++n) {
      const double e = (low + high) / 2;
      (e * (1.6 + e * (-2.2 + e * 1.6)) < light ? low : high) = e;
    }
    return low;
  };
  const double radius = std::hypot(360, 240);
  // Black must be black: light reflected by the print's black cannot be distinguished from a different curve near
  // zero.
  Photographs photographs;
  photographs.flare = 0;
  const auto photometry = fit_photometry(samples(photographs, radius, encode), 3, head(), radius);
  ASSERT_EQ(photometry.response.curve, Response::Curve::kPolynomial);
  double sum = 0;
  for (const double c : photometry.response.coefficients) sum += c;
  EXPECT_NEAR(sum, 1, 1e-9);
  for (const double e : {0.3, 0.5, 0.8}) {
    double light = 0;
    for (std::size_t k = 0; k < photometry.response.coefficients.size(); ++k) {
      light += photometry.response.coefficients[k] * std::pow(e, k + 1);
    }
    EXPECT_NEAR(light, e * (1.6 + e * (-2.2 + e * 1.6)), 0.012);
  }
}

}  // namespace
}  // namespace nodal::calibration
