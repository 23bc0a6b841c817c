#include "firmware/sync/drift.h"

#include <gtest/gtest.h>

#include "hal/sim/scene/random.h"

namespace nodal::firmware {
namespace {

constexpr FrameRate kDriftRate{30000, 1001};
constexpr Duration kDriftJitter = Duration::microseconds(200);
constexpr int kWindow = static_cast<int>(DriftMeter::kBlocks) * static_cast<int>(DriftMeter::kBlockPeriods);

/// Pulse n of a clock that is `ppm` slow, with jitter.
Instant pulse(int n, std::int64_t ppm, hal::sim::Random& random) {
  const Duration ideal = kDriftRate.start_of(static_cast<std::uint64_t>(n));
  return Instant::from_ns(5'000'000'000) + ideal + Duration::nanoseconds(ideal.us() * ppm / 1000) +
         random.around_zero(kDriftJitter);
}

TEST(DriftMeter, BeforeTwoBlocks_SaysNothing) {
  DriftMeter meter;
  hal::sim::Random random(1, "jitter");
  meter.restart(kDriftRate);
  for (int n = 0; n <= 2 * DriftMeter::kBlockPeriods; ++n) {
    EXPECT_FALSE(meter.ppb()) << n;
    meter.add(n, pulse(n, 0, random));
  }
  EXPECT_TRUE(meter.ppb());
}

TEST(DriftMeter, ClocksUpTo100Ppm_AreMeasuredToThreePpmThroughTheirJitter) {
  for (const std::int64_t ppm : {-100, -50, -7, 0, 1, 50, 100}) {
    DriftMeter meter;
    hal::sim::Random random(static_cast<std::uint64_t>(ppm + 1000), "jitter");
    meter.restart(kDriftRate);
    for (int n = 0; n < 3 * kWindow; ++n) meter.add(n, pulse(n, ppm, random));
    ASSERT_TRUE(meter.ppb());
    // Means of 256 uniform times, +-7 us each, 8.5 s apart: 1.2 ppm is one standard deviation.
    EXPECT_NEAR(static_cast<double>(*meter.ppb()) / 1000, static_cast<double>(ppm), 3.6);
  }
}

TEST(DriftMeter, MissingMoments_ChangeNothing) {
  DriftMeter meter;
  hal::sim::Random random(3, "jitter");
  meter.restart(kDriftRate);
  for (int n = 0; n < 3 * kWindow; ++n) {
    if (random.below(3) != 0) meter.add(n, pulse(n, 50, random));
  }
  ASSERT_TRUE(meter.ppb());
  EXPECT_NEAR(static_cast<double>(*meter.ppb()) / 1000, 50, 4.5);
}

TEST(DriftMeter, AClockThatIsSet_IsNoDrift) {
  DriftMeter meter;
  hal::sim::Random random(4, "jitter");
  meter.restart(kDriftRate);
  for (int n = 0; n < kWindow; ++n) meter.add(n, pulse(n, 20, random));
  for (int n = kWindow; n < kWindow + 100; ++n) meter.add(n, pulse(n, 20, random) + Duration::seconds(3600));
  ASSERT_TRUE(meter.ppb());
  EXPECT_NEAR(static_cast<double>(*meter.ppb()) / 1000, 20, 100);  // from two blocks only
}

TEST(DriftMeter, ADayOf50Ppm_IsStill50Ppm) {
  DriftMeter meter;
  hal::sim::Random random(5, "jitter");
  meter.restart(kDriftRate);
  for (int n = 0; n < 24 * 3600 * 30; ++n) meter.add(n, pulse(n, 50, random));
  ASSERT_TRUE(meter.ppb());
  EXPECT_NEAR(static_cast<double>(*meter.ppb()) / 1000, 50, 3.6);
}

}  // namespace
}  // namespace nodal::firmware
