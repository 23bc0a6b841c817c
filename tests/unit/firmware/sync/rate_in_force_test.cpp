// The rate at which sets come, from times that are made by hand.
#include "firmware/sync/rate_in_force.h"

#include <gtest/gtest.h>

namespace nodal::firmware {
namespace {

constexpr FrameRate kThirty{30, 1}, kNtsc{30'000, 1'001};

/// `count` sets, `step` apart, each off by up to 0.2 ms.
void feed(RateInForce& rate, Instant& at, int count, Duration step, std::optional<std::int32_t> drift = std::nullopt) {
  for (int k = 0; k < count; ++k) {
    at = at + step;
    rate.add(at + Duration::microseconds(k % 5 * 100 - 200), drift);
  }
}

TEST(RateInForce, AsCommanded_StaysExactThroughJitterAndGaps) {
  RateInForce rate;
  Instant at;
  rate.restart(kThirty);
  for (int k = 0; k < 20; ++k) {
    feed(rate, at, 30, kThirty.period(), 3'000);
    at = at + Duration::seconds(k);
    EXPECT_EQ(rate.rate(), kThirty);
  }
}

TEST(RateInForce, HeadsThatRunFreeAtAnother_IsTheirs) {
  RateInForce rate;
  Instant at;
  rate.restart(kThirty);
  feed(rate, at, 200, Duration::milliseconds(40));
  EXPECT_EQ(rate.rate(), (FrameRate{25, 1}));
  rate.restart({50, 1});
  EXPECT_EQ(rate.rate(), (FrameRate{50, 1}));
}

TEST(RateInForce, DriftThatIsMeasured_IsInItAboveTwentyPpm) {
  RateInForce rate;
  Instant at;
  rate.restart(kNtsc);
  feed(rate, at, 200, kNtsc.period(), 15'000);
  EXPECT_EQ(rate.rate(), kNtsc);
  feed(rate, at, 200, kNtsc.period(), 50'000);
  const double slower = static_cast<double>(rate.rate().period().ns()) / static_cast<double>(kNtsc.period().ns());
  EXPECT_NEAR(slower, 1.00005, 0.000002);
}

}  // namespace
}  // namespace nodal::firmware
