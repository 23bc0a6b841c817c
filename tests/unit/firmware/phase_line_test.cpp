#include "firmware/sync/phase_line.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstdlib>

#include "hal/sim/scene/random.h"

namespace nodal::firmware {
namespace {

constexpr Duration kPeriod = FrameRate{}.period();
constexpr Instant kBegin = Instant::from_ns(1'000'000'000'000);

/// The n-th exposure of a head whose crystal is so much off.
Instant exposure(std::int64_t n, std::int64_t ppm) {
  return kBegin + kPeriod * n + Duration::nanoseconds(kPeriod.ns() * n / 1'000'000 * ppm);
}

RC_GTEST_PROP(PhaseLine, AfterAMemorysWorthOfStampsThatJitter_PhaseAndRateAreKnown, ()) {
  const auto ppm = *rc::gen::inRange<std::int64_t>(-50, 51);
  const auto jitter = Duration::microseconds(*rc::gen::inRange<std::int64_t>(0, 201));
  hal::sim::Random random(*rc::gen::arbitrary<std::uint64_t>(), "stamps");
  PhaseLine line;
  line.restart(kPeriod);
  constexpr std::int64_t kMany = PhaseLine::kMemory;
  for (std::int64_t n = 0; n < kMany; ++n) line.add(exposure(n, ppm) + random.around_zero(jitter));
  const Instant next = exposure(kMany + 3, ppm);
  // Uniform stamps have a deviation of jitter / sqrt 3; a line's end has 2 / sqrt 512 of it, its rate 3.5 / 512^1.5.
  // Six deviations, and what integers round.
  RC_ASSERT(std::abs((line.nearest(next) - next).ns()) <= jitter.ns() * 3062 / 10000 + 300);
  RC_ASSERT(std::abs(*line.drift_ppb() - ppm * 1000) <= jitter.ns() * 1'000'000'000 / kPeriod.ns() / 956 + 40);
}

TEST(PhaseLine, ExactStamps_AreForetoldAtOnceAndGapsChangeNothing) {
  PhaseLine line;
  line.restart(kPeriod);
  for (std::int64_t n = 0; n < 200; ++n) {
    if (n % 7 != 3) line.add(exposure(n, 40));
  }
  EXPECT_NEAR(static_cast<double>((line.nearest(exposure(240, 40)) - exposure(240, 40)).ns()), 0, 2000);
  EXPECT_NEAR(*line.drift_ppb(), 40'000, 200);
}

TEST(PhaseLine, OneWildStamp_IsNotBelieved_ThreeAreANewPhaseOfTheSameCrystal) {
  PhaseLine line;
  line.restart(kPeriod);
  std::int64_t n = 0;
  for (; n < 300; ++n) line.add(exposure(n, 25));
  line.add(exposure(n++, 25) + Duration::milliseconds(9));
  EXPECT_NEAR(static_cast<double>((line.nearest(exposure(n, 25)) - exposure(n, 25)).ns()), 0, 1000);
  for (int i = 0; i < 3; ++i) line.add(exposure(n++, 25) + Duration::milliseconds(9));
  line.add(exposure(n++, 25) + Duration::milliseconds(9));
  const Instant moved = exposure(n + 100, 25) + Duration::milliseconds(9);
  EXPECT_NEAR(static_cast<double>((line.nearest(moved) - moved).ns()), 0, 5000) << "the rate was kept";
}

TEST(PhaseLine, ClockSetBackOrAheadByLessThanALeap_ThePhaseIsAnotherAtOnce) {
  for (const Duration by : {Duration::seconds(-3), Duration::seconds(-3) + Duration::milliseconds(1),
                            Duration::seconds(3) + Duration::milliseconds(1)}) {
    PhaseLine line;
    line.restart(kPeriod);
    for (std::int64_t n = 0; n < 400; ++n) line.add(exposure(n, 40));
    for (std::int64_t n = 400; n < 405; ++n) line.add(exposure(n, 40) + by);
    const Instant next = exposure(405, 40) + by;
    EXPECT_LE(std::abs((line.nearest(next) - next).ns()), 2000) << by.ms() << " ms";
  }
}

TEST(PhaseLine, NothingCameForLong_ItIsNotKnown) {
  PhaseLine line;
  line.restart(kPeriod);
  EXPECT_FALSE(line.known(kBegin));
  line.add(exposure(0, 0));
  EXPECT_FALSE(line.known(kBegin)) << "one stamp may be anything";
  line.add(exposure(1, 0));
  EXPECT_TRUE(line.known(exposure(2, 0)));
  EXPECT_FALSE(line.known(exposure(20, 0)));
}

}  // namespace
}  // namespace nodal::firmware
