#include "firmware/sync/offset_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "firmware/sync/clock_spec.h"

namespace nodal::firmware {
namespace {

constexpr double kNoise = clock_spec::kTimestampVarianceUs2;
constexpr double kDriftNoise = clock_spec::kDriftNoisePpm2PerS;

/// In the steady state of the Riccati equation, with gains alpha for the offset and beta / t for the drift:
/// the drift's variance gains q t and loses beta^2 r / (t^2 (1 - alpha)), so beta^2 / (1 - alpha) = q t^3 / r;
/// from the offset's variance and the covariance, alpha^2 + alpha beta + beta^2 / 6 = 2 beta.
TEST(OffsetFilter, AfterLong_TheGainIsTheOneOfTheRiccatiEquation) {
  for (const double period_s : {0.2, 0.1, 1 / 29.97}) {
    for (const double drift_noise : {1.0, kDriftNoise, 1000.0}) {
      OffsetFilter filter;
      filter.restart(0, kNoise, clock_spec::kDriftVariancePpm2);
      for (int i = 0; i < 20'000; ++i) {
        filter.predict(period_s, drift_noise);
        filter.update(0, kNoise);
      }
      const double alpha = filter.variance_us2() / kNoise;
      const double p = 2 - alpha;
      const double beta = 3 * (p - std::sqrt(p * p - alpha * alpha * 2 / 3));
      const double expected = drift_noise * period_s * period_s * period_s / kNoise;
      EXPECT_NEAR(beta * beta / (1 - alpha) / expected, 1, 1e-6) << period_s << " s, " << drift_noise;
    }
  }
}

/// The true drift follows the model's random walk, and the timestamps have the specified noise.
TEST(OffsetFilter, ATruthThatIsAsTheModelSays_IsWithinOneAndThreeDeviationsAsOftenAsItShould) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> error(-clock_spec::kTimestampErrorUs, clock_spec::kTimestampErrorUs);
  constexpr double kFilterPeriod = 0.1;
  int within_one = 0, within_three = 0, all = 0;
  for (int run = 0; run < 400; ++run) {
    double offset = 0, drift = std::sqrt(clock_spec::kDriftVariancePpm2) * normal(random);
    OffsetFilter filter;
    filter.restart(offset + error(random), kNoise, clock_spec::kDriftVariancePpm2);
    for (int i = 0; i < 100; ++i) {
      // Random walk over t: the drift's step is w, the offset's t w / 2 plus a rest with variance q t^3 / 12.
      const double w = std::sqrt(kDriftNoise * kFilterPeriod) * normal(random);
      offset += drift * kFilterPeriod + w * kFilterPeriod / 2 +
                std::sqrt(kDriftNoise * kFilterPeriod * kFilterPeriod * kFilterPeriod / 12) * normal(random);
      drift += w;
      filter.predict(kFilterPeriod, kDriftNoise);
      filter.update(offset + error(random), kNoise);
      const double off = std::abs(filter.offset_us() - offset), deviation = std::sqrt(filter.variance_us2());
      within_one += off <= deviation;
      within_three += off <= 3 * deviation;
      ++all;
    }
  }
  EXPECT_NEAR(static_cast<double>(within_one) / all, 0.683, 0.02);
  EXPECT_GE(static_cast<double>(within_three) / all, 0.9955);
}

TEST(OffsetFilter, ARampWithoutNoise_IsFollowedWithoutLag) {
  OffsetFilter filter;
  filter.restart(0, kNoise, clock_spec::kDriftVariancePpm2);
  for (int i = 1; i <= 2000; ++i) {
    filter.predict(0.1, kDriftNoise);
    filter.update(10.0 * i, kNoise);  // 100 ppm
  }
  EXPECT_NEAR(filter.offset_us(), 20'000, 0.01);
  EXPECT_NEAR(filter.drift_ppm(), 100, 0.01);
}

TEST(OffsetFilter, WithoutDriftNoiseOrDrift_ItIsTheMean) {
  OffsetFilter filter;
  filter.restart(10, kNoise, 0);
  for (const double measured : {20.0, 60.0, -10.0}) {
    filter.predict(0.1, 0);
    filter.update(measured, kNoise);
  }
  EXPECT_NEAR(filter.offset_us(), (10.0 + 20 + 60 - 10) / 4, 1e-9);
  EXPECT_NEAR(filter.variance_us2(), kNoise / 4, 1e-9);
}

TEST(OffsetFilter, MovedOnPurpose_TheEstimateMovesAndTheDoubtStays) {
  OffsetFilter filter;
  filter.restart(10, kNoise, 0);
  filter.move(-300);
  EXPECT_EQ(filter.offset_us(), -290);
  EXPECT_EQ(filter.variance_us2(), kNoise);
}

}  // namespace
}  // namespace nodal::firmware
