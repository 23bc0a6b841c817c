#include "firmware/set_clock.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

namespace nodal::firmware {
namespace {

constexpr FrameRate kNtsc{30000, 1001};
const Duration kPeriod = kNtsc.period();

Instant at_ms(std::int64_t ms) { return Instant::from_ns(ms * 1'000'000); }

SetClock locked_clock(int edges, Instant first) {
  SetClock clock(kNtsc);
  clock.restart(kNtsc, true);
  for (int n = 0; n < edges; ++n) {
    clock.on_edge({static_cast<std::uint64_t>(n), first + kNtsc.start_of(static_cast<std::uint64_t>(n))});
  }
  return clock;
}

TEST(SetClock, Genlocked_AFrameIsOfThePulseItsExposureBeganAt) {
  SetClock clock = locked_clock(5, at_ms(1000));
  const Exposure exposure = Exposure::microseconds(8000);
  const Instant begin = at_ms(1000) + kNtsc.start_of(3) + Duration::microseconds(20);
  const auto match = clock.match(begin + exposure.duration() / 2, exposure, Duration(), at_ms(1200));
  ASSERT_TRUE(match);
  EXPECT_EQ(match->trigger, 3u);
  EXPECT_EQ(match->skew, Duration::microseconds(20));
}

TEST(SetClock, Genlocked_ExposuresOfAnyLengthAndDelayGoToTheirPulse) {
  rc::check([] {
    SetClock clock = locked_clock(20, at_ms(1000));
    const auto pulse = static_cast<std::uint64_t>(*rc::gen::inRange(0, 20));
    const Exposure exposure = Exposure::microseconds(*rc::gen::inRange(10, 33'000));
    const Duration delay = Duration::microseconds(*rc::gen::inRange(0, 10'000));
    const Duration jitter = Duration::microseconds(*rc::gen::inRange(-15'000, 15'000));
    const Instant middle = at_ms(1000) + kNtsc.start_of(pulse) + delay + jitter + exposure.duration() / 2;
    const auto match = clock.match(middle, exposure, delay, middle);
    RC_ASSERT(match.has_value());
    RC_ASSERT(match->trigger == pulse);
    RC_ASSERT(match->skew == jitter);
  });
}

TEST(SetClock, Genlocked_AFrameFarFromEveryPulseIsOfNone) {
  SetClock clock = locked_clock(5, at_ms(1000));
  const Instant now = at_ms(1000) + kNtsc.start_of(4);
  EXPECT_FALSE(clock.match(at_ms(900), Exposure::microseconds(10), Duration(), now));
}

TEST(SetClock, PulsesStop_FramesGoOnByTheGridInRisingSlots) {
  SetClock clock = locked_clock(5, at_ms(1000));
  SetClock::Slot last = -1;
  for (std::uint64_t n = 0; n < 60; ++n) {
    const Instant middle = at_ms(1000) + kNtsc.start_of(n);
    const Instant arrival = middle + Duration::milliseconds(20);
    const auto match = clock.match(middle, Exposure::microseconds(10), Duration(), arrival);
    if (n < 5) {
      ASSERT_TRUE(match && match->trigger == n);
    } else if (!match) {
      EXPECT_LT(n, 8u) << "long after the last pulse";
      continue;
    } else {
      EXPECT_FALSE(match->trigger);
    }
    EXPECT_GT(match->slot, last);
    last = match->slot;
  }
}

TEST(SetClock, InFreeRun_HeadsOfAnyPhaseWithinAQuarterPeriodShareEverySlot) {
  rc::check([] {
    SetClock clock(kNtsc);
    clock.restart(kNtsc, false);
    const std::int64_t quarter = kPeriod.ns() / 4;
    const auto phases = *rc::gen::container<std::vector<std::int64_t>>(
        5, rc::gen::inRange<std::int64_t>(-quarter + 100'000, quarter - 100'000));
    for (std::uint64_t n = 0; n < 100; ++n) {
      std::optional<SetClock::Slot> slot;
      for (const std::int64_t phase : phases) {
        const Instant middle = at_ms(1000) + kNtsc.start_of(n) + Duration::nanoseconds(phase);
        const auto match = clock.match(middle, Exposure::microseconds(8000), Duration(), middle);
        RC_ASSERT(match.has_value());
        if (n < 50) continue;  // the grid has found the heads by then
        if (!slot) slot = match->slot;
        RC_ASSERT(match->slot == *slot);
      }
    }
  });
}

TEST(SetClock, InFreeRun_AnHourOfDriftSkipsNoSlot) {
  for (const std::int64_t ppm : {-100, 100}) {
    SetClock clock(kNtsc);
    clock.restart(kNtsc, false);
    SetClock::Slot last = 0;
    Instant middle = at_ms(1000);
    const Duration period = Duration::nanoseconds(kPeriod.ns() + kPeriod.ns() * ppm / 1'000'000);
    for (int n = 0; n < 107'892; ++n) {
      middle = middle + period;
      const auto match = clock.match(middle, Exposure::microseconds(8000), Duration(), middle);
      ASSERT_TRUE(match);
      if (n > 0) {
        ASSERT_EQ(match->slot, last + 1) << "frame " << n << " at " << ppm << " ppm";
      }
      last = match->slot;
    }
  }
}

TEST(SetClock, Restarted_SlotsGoOnRising) {
  SetClock clock = locked_clock(9, at_ms(1000));
  const auto before = clock.match(at_ms(1000) + kNtsc.start_of(8), Exposure::microseconds(10), Duration(), at_ms(1300));
  ASSERT_TRUE(before);
  clock.restart(kNtsc, true);
  clock.on_edge({0, at_ms(2000)});
  const auto after = clock.match(at_ms(2000), Exposure::microseconds(10), Duration(), at_ms(2010));
  ASSERT_TRUE(after);
  EXPECT_EQ(after->trigger, 0u);
  EXPECT_GT(after->slot, before->slot);
}

}  // namespace
}  // namespace nodal::firmware
