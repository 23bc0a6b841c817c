// Transforms and correlations against their definitions as sums.
#include "stitch/timing/fourier.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "stitch/timing/sinc.h"

namespace nodal::timing {
namespace {

std::vector<double> noise(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> values(count);
  for (double& x : values) x = normal(random);
  return values;
}

TEST(QuickLength, AnyCount_IsAtLeastThatAndHasSmallFactors) {
  EXPECT_EQ(quick_length(0), 4u);
  EXPECT_EQ(quick_length(4), 4u);
  EXPECT_EQ(quick_length(5), 8u);
  EXPECT_EQ(quick_length(4097), 4320u);  // 4 * 2^3 * 3^3 * 5
}

TEST(Fourier, LengthWithThreePrimes_GivesTheDefinitionsSumAndItsInverse) {
  const auto x = noise(60, 1);
  Fourier fourier(60);
  const auto spectrum = fourier.forward(x);
  ASSERT_EQ(spectrum.size(), 31u);
  for (std::size_t k = 0; k < spectrum.size(); ++k) {
    std::complex<double> sum = 0;
    for (std::size_t i = 0; i < 60; ++i) {
      sum += x[i] * std::polar(1.0, -2 * std::numbers::pi * static_cast<double>(i * k) / 60);
    }
    EXPECT_NEAR(std::abs(spectrum[k] - sum), 0, 1e-12);
  }
  const auto back = fourier.inverse(spectrum);
  for (std::size_t i = 0; i < 60; ++i) EXPECT_NEAR(back[i], x[i], 1e-13);
}

TEST(Correlate, PlacesInsideTheLongerOne_AreTheDefinitionsSums) {
  const auto a = noise(37, 2), b = noise(101, 3);
  const auto sums = correlate(a, b);
  ASSERT_EQ(sums.size(), 65u);
  const auto coefficients = correlation_coefficients(a, b);
  for (std::size_t k = 0; k < sums.size(); ++k) {
    double sum = 0, aa = 0, bb = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i + k], aa += a[i] * a[i], bb += b[i + k] * b[i + k];
    EXPECT_NEAR(sums[k], sum, 1e-11);
    EXPECT_NEAR(coefficients[k], sum / std::sqrt(aa * bb), 1e-12);
  }
  EXPECT_TRUE(correlate(b, a).empty());
  EXPECT_TRUE(correlate({}, a).empty());
}

TEST(CorrelationCoefficients, PartThatIsZero_IsZeroAndNotInfinite) {
  std::vector<double> b(50, 0.0);
  for (std::size_t i = 25; i < 50; ++i) b[i] = noise(50, 4)[i];
  for (const double x : correlation_coefficients(noise(10, 5), b)) EXPECT_LE(std::abs(x), 1 + 1e-9);
}

TEST(SincTable, WaveBelowFourTenthsOfTheRate_IsReadBetweenSamples) {
  const SincTable sinc;
  for (const double cycles : {0.03, 0.21, 0.4}) {
    std::vector<double> wave(200);
    for (std::size_t i = 0; i < wave.size(); ++i)
      wave[i] = std::cos(2 * std::numbers::pi * cycles * static_cast<double>(i));
    for (double place = 80; place < 82; place += 0.037) {
      EXPECT_NEAR(sinc.value(wave, place), std::cos(2 * std::numbers::pi * cycles * place), 1e-3);
    }
  }
  EXPECT_EQ(sinc.value(std::vector<double>{1, 1}, 500), 0);
  EXPECT_EQ(sinc.value(std::vector<double>{1, 1}, std::nan("")), 0);
}

}  // namespace
}  // namespace nodal::timing
