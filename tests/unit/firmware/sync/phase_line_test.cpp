#include "firmware/sync/phase_line.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstdlib>

#include "hal/sim/scene/random.h"

namespace nodal::firmware {
namespace {

constexpr Duration kLinePeriod = FrameRate{}.period();
constexpr Instant kBegin = Instant::from_ns(1'000'000'000'000);

/// The n-th exposure of a head whose crystal is off by `ppm`.
Instant exposure(std::int64_t n, std::int64_t ppm) {
  return kBegin + kLinePeriod * n + Duration::nanoseconds(kLinePeriod.ns() * n / 1'000'000 * ppm);
}

RC_GTEST_PROP(PhaseLine, AfterManyTimestampsWithNoise_PhaseAndRateAreWithinSixDeviations, ()) {
  const auto ppm = *rc::gen::inRange<std::int64_t>(-50, 51);
  const auto jitter = Duration::microseconds(*rc::gen::inRange<std::int64_t>(0, 201));
  hal::sim::Random random(*rc::gen::arbitrary<std::uint64_t>(), "stamps");
  PhaseLine line;
  line.restart(kLinePeriod);
  constexpr std::int64_t kMany = 512;
  for (std::int64_t n = 0; n < kMany; ++n) line.add(exposure(n, ppm) + random.around_zero(jitter));
  const Instant next = exposure(kMany + 3, ppm);
  // Uniform timestamps have a deviation of jitter / sqrt 3; a line's end has 2 / sqrt 512 of it, its rate
  // 3.5 / 512^1.5. The filter gives late timestamps more weight, because crystals wander: 1.5 times. Six deviations,
  // plus the effect of the rate's own variance of 41 ppm: 0.03 ppm.
  RC_ASSERT(std::abs((line.nearest(next) - next).ns()) <= jitter.ns() * 3062 / 10000 * 3 / 2 + 500);
  RC_ASSERT(std::abs(*line.drift_ppb() - ppm * 1000) <=
            jitter.ns() * 1'000'000'000 / kLinePeriod.ns() / 956 * 3 / 2 + 100);
}

TEST(PhaseLine, ExactStamps_AreForetoldAtOnceAndGapsChangeNothing) {
  PhaseLine line;
  line.restart(kLinePeriod);
  for (std::int64_t n = 0; n < 200; ++n) {
    if (n % 7 != 3) line.add(exposure(n, 40));
  }
  // The rate's variance from 171 timestamps is 12 x 115^2 / (199^3 x 33 ms^2) = (4.3 ppm)^2, compared with (41 ppm)^2
  // before: the old value of 0 keeps 1.1 %, and half as much again by the filter's weight on late timestamps. After 41
  // periods this is 0.9 us, in addition to the error of the phase.
  EXPECT_NEAR(static_cast<double>((line.nearest(exposure(240, 40)) - exposure(240, 40)).ns()), 0, 3000);
  EXPECT_NEAR(*line.drift_ppb(), 40'000, 40'000 * 0.011 * 1.5);
}

TEST(PhaseLine, OneWildStamp_IsNotBelieved_ThreeAreANewPhaseOfTheSameCrystal) {
  PhaseLine line;
  line.restart(kLinePeriod);
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
    line.restart(kLinePeriod);
    for (std::int64_t n = 0; n < 400; ++n) line.add(exposure(n, 40));
    for (std::int64_t n = 400; n < 405; ++n) line.add(exposure(n, 40) + by);
    const Instant next = exposure(405, 40) + by;
    EXPECT_LE(std::abs((line.nearest(next) - next).ns()), 2000) << by.ms() << " ms";
  }
}

TEST(PhaseLine, NothingCameForLong_ItIsNotKnown) {
  PhaseLine line;
  line.restart(kLinePeriod);
  EXPECT_FALSE(line.known(kBegin));
  line.add(exposure(0, 0));
  EXPECT_FALSE(line.known(kBegin)) << "one stamp may be anything";
  line.add(exposure(1, 0));
  EXPECT_TRUE(line.known(exposure(2, 0)));
  EXPECT_FALSE(line.known(exposure(20, 0)));
}

}  // namespace
}  // namespace nodal::firmware
