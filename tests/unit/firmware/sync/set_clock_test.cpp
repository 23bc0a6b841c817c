#include "firmware/sync/set_clock.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <array>

namespace nodal::firmware {
namespace {

constexpr FrameRate kClockRate{30000, 1001};
const Duration kClockPeriod = kClockRate.period();

Instant at_ms(std::int64_t ms) { return Instant::from_ns(ms * 1'000'000); }

SetClock locked_clock(int edges, Instant first) {
  SetClock clock(kClockRate);
  clock.restart(kClockRate, true, Instant());
  for (int n = 0; n < edges; ++n) {
    clock.on_edge({static_cast<std::uint64_t>(n), first + kClockRate.start_of(static_cast<std::uint64_t>(n))});
  }
  return clock;
}

// A wired head streams on when the genlock stops, so its frames of former pulses still arrive.
TEST(SetClock, FreeRun_AFrameFromBeforeTheRestartIsInNoSet) {
  SetClock clock = locked_clock(5, at_ms(1000));
  clock.restart(kClockRate, false, at_ms(1100));
  const Exposure exposure = Exposure::microseconds(8000);
  EXPECT_FALSE(clock.match(0, at_ms(1103), exposure, Duration()));
  EXPECT_FALSE(clock.match(0, at_ms(1110), exposure, Duration::milliseconds(7)));
  EXPECT_TRUE(clock.match(0, at_ms(1105), exposure, Duration()));
}

TEST(SetClock, Genlocked_AFrameIsOfThePulseItsExposureBeganAt) {
  SetClock clock = locked_clock(5, at_ms(1000));
  const Exposure exposure = Exposure::microseconds(8000);
  const Instant begin = at_ms(1000) + kClockRate.start_of(3) + Duration::microseconds(20);
  const auto match = clock.match(0, begin + exposure.duration() / 2, exposure, Duration());
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
    const Instant middle = at_ms(1000) + kClockRate.start_of(pulse) + delay + jitter + exposure.duration() / 2;
    const auto match = clock.match(0, middle, exposure, delay);
    RC_ASSERT(match.has_value());
    RC_ASSERT(match->trigger == pulse);
    RC_ASSERT(match->skew == jitter);
  });
}

TEST(SetClock, Genlocked_AFrameFarFromEveryPulseIsOfNone) {
  SetClock clock = locked_clock(5, at_ms(1000));
  EXPECT_FALSE(clock.match(0, at_ms(900), Exposure::microseconds(10), Duration()));
}

TEST(SetClock, PulsesStop_FramesGoOnByTheGridInRisingSlots) {
  SetClock clock = locked_clock(5, at_ms(1000));
  SetClock::Slot last = -1;
  for (std::uint64_t n = 0; n < 60; ++n) {
    const Instant middle = at_ms(1000) + kClockRate.start_of(n);
    const auto match = clock.match(0, middle, Exposure::microseconds(10), Duration());
    if (n < 5) {
      ASSERT_TRUE(match && match->trigger == n);
    } else {
      ASSERT_TRUE(match && !match->trigger);
    }
    clock.follow(match->slot, middle);
    EXPECT_GT(match->slot, last);
    last = match->slot;
  }
}

TEST(SetClock, InFreeRun_HeadsOfAnyPhaseWithinAQuarterPeriodShareEverySlot) {
  rc::check([] {
    SetClock clock(kClockRate);
    clock.restart(kClockRate, false, Instant());
    const std::int64_t quarter = kClockPeriod.ns() / 4;
    const auto phases = *rc::gen::container<std::vector<std::int64_t>>(
        5, rc::gen::inRange<std::int64_t>(-quarter + 100'000, quarter - 100'000));
    for (std::uint64_t n = 0; n < 100; ++n) {
      std::optional<SetClock::Slot> slot;
      std::vector<std::int64_t> sorted = phases;
      std::sort(sorted.begin(), sorted.end());
      for (std::size_t head = 0; head < phases.size(); ++head) {
        const Instant middle = at_ms(1000) + kClockRate.start_of(n) + Duration::nanoseconds(phases[head]);
        const auto match = clock.match(head, middle, Exposure::microseconds(8000), Duration());
        RC_ASSERT(match.has_value());
        if (head + 1 == phases.size()) {
          clock.follow(match->slot, at_ms(1000) + kClockRate.start_of(n) + Duration::nanoseconds(sorted[2]));
        }
        if (n < 50) continue;  // by then the grid has found the heads
        if (!slot) slot = match->slot;
        RC_ASSERT(match->slot == *slot);
      }
    }
  });
}

TEST(SetClock, InFreeRun_AnHourOfDriftSkipsNoSlot) {
  for (const std::int64_t ppm : {-100, 100}) {
    SetClock clock(kClockRate);
    clock.restart(kClockRate, false, Instant());
    SetClock::Slot last = 0;
    Instant middle = at_ms(1000);
    const Duration period = Duration::nanoseconds(kClockPeriod.ns() + kClockPeriod.ns() * ppm / 1'000'000);
    for (int n = 0; n < 107'892; ++n) {
      middle = middle + period;
      const auto match = clock.match(0, middle, Exposure::microseconds(8000), Duration());
      ASSERT_TRUE(match);
      clock.follow(match->slot, middle);
      if (n > 0) {
        ASSERT_EQ(match->slot, last + 1) << "frame " << n << " at " << ppm << " ppm";
      }
      last = match->slot;
    }
  }
}

// Found by the swarm: 8 heads at 25 frames per second; a head whose phase is at the boundary of two periods alternated
// between them, and a set held exposures 52 ms apart.
TEST(SetClock, InFreeRun_AHeadWherePeriodsMeetKeepsItsStep) {
  SetClock clock(kClockRate);
  clock.restart(kClockRate, false, Instant());
  std::optional<SetClock::Slot> last;
  for (std::uint64_t n = 0; n < 200; ++n) {
    const Instant middle = at_ms(1000) + kClockRate.start_of(n);
    const auto steady = clock.match(0, middle, Exposure(), Duration());
    // Half a period away, +- 0.2 ms.
    const Duration jitter = Duration::microseconds(n % 2 == 0 ? 200 : -200);
    const auto other = clock.match(1, middle + kClockPeriod / 2 + jitter, Exposure(), Duration());
    ASSERT_TRUE(steady && other);
    if (last) {
      EXPECT_EQ(other->slot, *last + 1) << "frame " << n;
    }
    last = other->slot;
    clock.follow(steady->slot, middle);
  }
}

// Found by the swarm: the copy of a frame far from the grid's middle was assigned to the next set.
TEST(SetClock, InFreeRun_AFrameThatComesTwiceIsOfTheSameSlotWhereverTheGridWent) {
  SetClock clock(kClockRate);
  clock.restart(kClockRate, false, Instant());
  const Instant first = at_ms(1000);
  ASSERT_TRUE(clock.match(0, first, Exposure(), Duration()));
  const Instant late = first + kClockPeriod + kClockPeriod * 45 / 100;
  const auto once = clock.match(1, late, Exposure(), Duration());
  for (int set = 0; set < 8; ++set) clock.follow(once->slot, late - kClockPeriod * 95 / 100);
  const auto twice = clock.match(1, late, Exposure(), Duration());
  ASSERT_TRUE(once && twice);
  EXPECT_EQ(twice->slot, once->slot);
}

TEST(SetClock, Genlocked_WhatWasExposedBeforeTheStartIsOfNoPulse) {
  SetClock clock(kClockRate);
  clock.restart(kClockRate, true, at_ms(2000));
  clock.on_edge({0, at_ms(2001)});
  EXPECT_FALSE(clock.match(0, at_ms(1998), Exposure::microseconds(10), Duration()));
  EXPECT_TRUE(clock.match(0, at_ms(2002), Exposure::microseconds(10), Duration()));
}

TEST(SetClock, Genlocked_AFrameWhosePulseWasNotSeenIsOfTheNumberInBetween) {
  SetClock clock(kClockRate);
  clock.restart(kClockRate, true, Instant());
  std::array<SetClock::Slot, 6> slots{};
  for (const std::uint64_t n : {0, 1, 2, 4, 5}) clock.on_edge({n, at_ms(1000) + kClockRate.start_of(n)});
  for (std::uint64_t n = 0; n < slots.size(); ++n) {
    const Instant begin = at_ms(1000) + kClockRate.start_of(n) + Duration::microseconds(20);
    const auto match = clock.match(0, begin + Duration::microseconds(5), Exposure::microseconds(10), Duration());
    ASSERT_TRUE(match);
    EXPECT_EQ(match->trigger.has_value(), n != 3);
    slots[n] = match->slot;
    clock.follow(match->slot, begin);
    EXPECT_EQ(slots[n], slots[0] + static_cast<SetClock::Slot>(n));
  }
}

TEST(SetClock, Restarted_SlotsGoOnRising) {
  SetClock clock = locked_clock(9, at_ms(1000));
  const auto before = clock.match(0, at_ms(1000) + kClockRate.start_of(8), Exposure::microseconds(10), Duration());
  ASSERT_TRUE(before);
  clock.restart(kClockRate, true, Instant());
  clock.on_edge({0, at_ms(2000)});
  const auto after = clock.match(0, at_ms(2000), Exposure::microseconds(10), Duration());
  ASSERT_TRUE(after);
  EXPECT_EQ(after->trigger, 0u);
  EXPECT_GT(after->slot, before->slot);
}

// Found by the swarm: the last pulse of an older train exposed a head; the frame's timestamp was 0.1 ms after the start
// of the new train, and the frame was taken for that train's pulse 0.
TEST(SetClock, Genlocked_WhatWasExposedJustBeforeTheTrainBegan_IsNotOfItsFirstPulse) {
  SetClock clock(kClockRate);
  clock.restart(kClockRate, true, at_ms(2000));
  clock.on_edge({0, at_ms(2001)});
  const auto exposed = [&](Duration after) {
    return clock.match(0, at_ms(2000) + after + Duration::microseconds(5), Exposure::microseconds(10), Duration());
  };
  EXPECT_FALSE(exposed(Duration::microseconds(400)));
  const auto first = exposed(Duration::microseconds(900));  // a timestamp may be 0.1 ms early
  ASSERT_TRUE(first);
  EXPECT_EQ(first->trigger, 0u);
}

}  // namespace
}  // namespace nodal::firmware
