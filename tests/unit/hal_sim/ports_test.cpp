// Features of the simulated ports beyond those of every port: faults, drift, and queries for tests.
#include <gtest/gtest.h>

#include <vector>

#include "hal/sim/clock.h"
#include "hal/sim/pin.h"
#include "hal/sim/scene/random.h"
#include "hal/sim/trigger.h"
#include "hal/sim/watchdog.h"

namespace nodal::hal::sim {
namespace {

std::vector<TriggerEdge> edges_of(SimTrigger& trigger) {
  std::vector<TriggerEdge> all;
  while (auto edge = trigger.take_edge().value()) all.push_back(*edge);
  return all;
}

TEST(SimTrigger, PulseLost_ItsNumberIsMissing) {
  SimClock clock;
  SimTrigger trigger(clock, {}, 1);
  ASSERT_TRUE(trigger.start({}));
  clock.advance(Duration::milliseconds(100));
  EXPECT_EQ(edges_of(trigger).back().number, 2U);
  trigger.lose_pulse();
  clock.advance(Duration::milliseconds(100));
  const auto edges = edges_of(trigger);
  ASSERT_FALSE(edges.empty());
  EXPECT_EQ(edges.front().number, 4U);
  EXPECT_EQ(trigger.pulses_sent(), edges.back().number);
}

TEST(SimTrigger, SlowCrystal_IsLateByItsPpb) {
  SimClock clock;
  TriggerOptions options;
  options.drift_ppb = 20'000;
  SimTrigger trigger(clock, options, 1);
  TriggerSettings settings;
  settings.rate = {1, 1};
  ASSERT_TRUE(trigger.start(settings));
  const Instant start = clock.now() + options.first_pulse;
  clock.advance(Duration::seconds(101));
  const auto edges = edges_of(trigger);
  ASSERT_EQ(edges.back().number, 100U);
  EXPECT_EQ((edges.back().at - start).ns(), 100'000'000'000 + 2'000'000);
}

TEST(SimTrigger, Jitter_StaysWithinItsReachAndUsesIt) {
  SimClock clock;
  TriggerOptions options;
  options.jitter = Duration::microseconds(100);
  SimTrigger trigger(clock, options, 9);
  ASSERT_TRUE(trigger.start({}));
  const Instant start = clock.now() + options.first_pulse;
  std::int64_t least = 0;
  std::int64_t most = 0;
  for (int i = 0; i < 50; ++i) {
    clock.advance(Duration::milliseconds(200));
    for (const TriggerEdge& edge : edges_of(trigger)) {
      const std::int64_t off = (edge.at - start - FrameRate{}.start_of(edge.number)).ns();
      least = std::min(least, off);
      most = std::max(most, off);
    }
  }
  EXPECT_GE(least, -100'000);
  EXPECT_LE(most, 100'000);
  EXPECT_LT(least, -80'000);
  EXPECT_GT(most, 80'000);
}

TEST(SimTrigger, Unplugged_SaysSoForGood) {
  SimClock clock;
  SimTrigger trigger(clock, {}, 1);
  ASSERT_TRUE(trigger.start({}));
  trigger.unplug();
  clock.advance(Duration::seconds(1));
  EXPECT_EQ(trigger.take_edge().error().code, Errc::kDeviceGone);
  EXPECT_EQ(trigger.start({}).error().code, Errc::kDeviceGone);
  EXPECT_EQ(trigger.pulses_sent(), 0U);
}

TEST(SimTrigger, EdgesNobodyTakes_AreBoundedAndCounted) {
  SimClock clock;
  SimTrigger trigger(clock, {}, 1);
  ASSERT_TRUE(trigger.start({}));
  clock.advance(Duration::seconds(100));
  const auto edges = edges_of(trigger);
  EXPECT_EQ(edges.size(), 256U);
  EXPECT_EQ(trigger.edges_forgotten() + edges.size(), trigger.pulses_sent());
}

TEST(SimOutputPin, ProgramDiesHoldingIt_TheWireIsSafeWhenTheLeaseEnds) {
  SimOutputPin pin(false);
  const Instant now = Instant::from_ns(0);
  ASSERT_TRUE(pin.set(true, now, Duration::milliseconds(10)));
  EXPECT_TRUE(pin.level_at(now + Duration::milliseconds(9)));
  EXPECT_FALSE(pin.level_at(now + Duration::milliseconds(10)));
}

TEST(SimOutputPin, History_SaysWhenTheLeaseEndedNotWhenItWasNoticed) {
  SimOutputPin pin(false);
  const Instant now = Instant::from_ns(0);
  ASSERT_TRUE(pin.set(true, now, Duration::milliseconds(10)));
  ASSERT_TRUE(pin.step(now + Duration::milliseconds(35)));
  ASSERT_EQ(pin.history().size(), 2U);
  EXPECT_EQ(pin.history()[1].at, now + Duration::milliseconds(10));
  EXPECT_FALSE(pin.history()[1].high);
}

TEST(SimInputPin, ScriptWithoutChange_MakesNoEdge) {
  SimClock clock;
  SimInputPin pin(clock);
  pin.script(clock.now(), false);
  pin.script(clock.now() + Duration::milliseconds(1), true);
  pin.script(clock.now() + Duration::milliseconds(2), true);
  clock.advance(Duration::milliseconds(5));
  EXPECT_TRUE(pin.take_edge().value());
  EXPECT_FALSE(pin.take_edge().value());
  pin.unplug();
  EXPECT_EQ(pin.level().error().code, Errc::kDeviceGone);
}

TEST(SimWatchdog, NotFedInTime_WouldBiteButNotBeforeReady) {
  SimClock clock;
  SimWatchdog watchdog(clock);
  clock.advance(Duration::seconds(60));
  EXPECT_FALSE(watchdog.would_bite(Duration::seconds(2)));
  watchdog.ready();
  clock.advance(Duration::seconds(2));
  EXPECT_FALSE(watchdog.would_bite(Duration::seconds(2)));
  watchdog.feed();
  clock.advance(Duration::milliseconds(2001));
  EXPECT_TRUE(watchdog.would_bite(Duration::seconds(2)));
}

// A seed in a report must give the same run on every machine and in every later build.
TEST(Random, KnownStream_StaysTheSame) {
  Random random(1, "trigger");
  Random again(1, "trigger");
  Random other(1, "disk");
  const std::uint64_t first = random.next();
  EXPECT_EQ(first, again.next());
  EXPECT_NE(first, other.next());
  // splitmix64 from state 1234567: the first numbers of its authors' test.
  struct Raw {
    std::uint64_t state = 1234567;
    std::uint64_t next() {
      std::uint64_t z = (state += 0x9E3779B97F4A7C15ULL);
      z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
      z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
      return z ^ (z >> 31);
    }
  } raw;
  EXPECT_EQ(raw.next(), 6457827717110365317ULL);
  EXPECT_EQ(raw.next(), 3203168211198807973ULL);
}

TEST(Random, AroundZero_CoversItsReachAndNoMore) {
  Random random(3, "x");
  bool low = false;
  bool high = false;
  for (int i = 0; i < 1000; ++i) {
    const std::int64_t d = random.around_zero(Duration::nanoseconds(3)).ns();
    ASSERT_LE(std::abs(d), 3);
    low |= d == -3;
    high |= d == 3;
  }
  EXPECT_TRUE(low && high);
  EXPECT_EQ(random.around_zero({}), Duration{});
}

}  // namespace
}  // namespace nodal::hal::sim
