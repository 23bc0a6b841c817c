#include "firmware/sync/genlock.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "hal/sim/clock.h"
#include "hal/sim/scene/random.h"
#include "hal/sim/trigger.h"

namespace nodal::firmware {
namespace {

/// One measurement is more uncertain than the limit allows, so the first set never counts as in lock.
constexpr int kSetsFromStart = Genlock::kSetsToLock + 1;

class GenlockTest : public testing::Test {
 protected:
  /// One period, with a set at its end: its first exposure begins `latency` after the pulse, and its last `apart`
  /// later. Nothing: no pulse exposed the set.
  void period(std::optional<Duration> apart, Duration latency = Duration::microseconds(20)) {
    clock.advance(settings.rate.period());
    while (genlock.take_edge(clock.now())) {}
    Skews skews;
    if (apart) skews.add(0, latency), skews.add(1, latency + *apart);
    set(skews, apart.value_or(Duration()));
    genlock.step(clock.now());
  }
  /// The same for two heads whose exposures begin so long after the pulse; without `second`, for the first head only.
  void one_period(Duration first, std::optional<Duration> second) {
    clock.advance(settings.rate.period());
    while (genlock.take_edge(clock.now())) {}
    Skews skews;
    skews.add(0, first);
    if (second) skews.add(1, *second);
    set(skews, second.value_or(first) - first, second ? 3 : 1);
  }
  /// A set with the frames of two heads; the second head's are later by `apart`.
  void set(const Skews& skews, Duration apart, HeadMask heads = 3) {
    FrameSet closed;
    closed.mask = heads;
    closed.sync.spread = Duration::microseconds(30);
    closed.sync.offset[1] = apart;
    closed.mid_exposure = exposed.value_or(clock.now());
    genlock.on_set(closed, skews, true, clock.now());
  }
  void lock() {
    ASSERT_TRUE(genlock.start(settings, clock.now()));
    for (int i = 0; i < 2 * Genlock::kSetsToLock; ++i) period(Duration::microseconds(20));
    ASSERT_EQ(genlock.state(), GenlockState::kLocked);
  }

  hal::sim::SimClock clock;
  std::optional<Instant> exposed;  ///< mid-exposure of the following sets; nothing: now
  hal::sim::SimTrigger trigger{clock, {}, 1};
  hal::TriggerSettings settings;
  Genlock genlock{&trigger};
};

TEST_F(GenlockTest, GoodSetsInARow_Lock) {
  ASSERT_TRUE(genlock.start(settings, clock.now()));
  for (int i = 0; i < kSetsFromStart; ++i) {
    EXPECT_EQ(genlock.state(), GenlockState::kAcquiring);
    period(Duration::microseconds(20));
  }
  EXPECT_EQ(genlock.state(), GenlockState::kLocked);
  EXPECT_EQ(genlock.report().spread_worst, Duration::microseconds(30));
}

TEST_F(GenlockTest, ABadSetInBetween_CountsAnew) {
  ASSERT_TRUE(genlock.start(settings, clock.now()));
  for (int i = 0; i < 10; ++i) {
    for (int good = 0; good < Genlock::kSetsToLock - 1; ++good) period(Duration::microseconds(250));
    period(Duration::microseconds(501));
    EXPECT_EQ(genlock.state(), GenlockState::kAcquiring);
  }
}

TEST_F(GenlockTest, Locked_OneSetOffIsLostAtOnce) {
  lock();
  period(Duration::microseconds(501));
  EXPECT_EQ(genlock.state(), GenlockState::kLost);
  for (int i = 0; i < kSetsFromStart; ++i) period(Duration::microseconds(20));
  EXPECT_EQ(genlock.state(), GenlockState::kLocked);
}

TEST_F(GenlockTest, ALatencyThatAllHeadsShare_IsNoFault) {
  ASSERT_TRUE(genlock.start(settings, clock.now()));
  for (int i = 0; i < 10; ++i) period(Duration::microseconds(20), Duration::milliseconds(-5));
  EXPECT_EQ(genlock.state(), GenlockState::kLocked);
}

TEST_F(GenlockTest, HeadsThatRunFreeBesideThePulses_AreLostOnceHalfAMillisecondCreptIn) {
  lock();
  for (int i = 0; i < 2000; ++i) {
    period(Duration::microseconds(20), Duration::microseconds(20 + 5 * i));  // 150 ppm
    EXPECT_EQ(genlock.state(), i <= 100 ? GenlockState::kLocked : GenlockState::kLost) << i;
  }
}

TEST_F(GenlockTest, Locked_ASetThatNoPulseExposedAndIsNotInStepIsLost) {
  lock();
  clock.advance(settings.rate.period());
  set({}, Duration::milliseconds(2));
  EXPECT_EQ(genlock.state(), GenlockState::kLost);
}

TEST_F(GenlockTest, Locked_PulsesAreNotSeenWhileHeadsStayInStepIsHoldoverUntilTheyAreAgain) {
  lock();
  for (int i = 0; i < 3; ++i) {
    clock.advance(settings.rate.period());
    set({}, Duration::microseconds(20));
    EXPECT_EQ(genlock.state(), GenlockState::kHoldover);
  }
  for (int i = 0; i < Genlock::kSetsToLock; ++i) period(Duration::microseconds(20));
  EXPECT_EQ(genlock.state(), GenlockState::kLocked);
  EXPECT_EQ(genlock.report().holdovers, 1u);
  EXPECT_EQ(genlock.report().losses, 0u);
}

TEST_F(GenlockTest, Holdover_LastsFiveSecondsAndIsThenALoss) {
  lock();
  Duration coasted;
  for (; coasted <= Genlock::kHoldover; coasted = coasted + settings.rate.period()) {
    clock.advance(settings.rate.period());
    set({}, Duration::microseconds(20));
    genlock.step(clock.now());
    EXPECT_EQ(genlock.state(), GenlockState::kHoldover) << coasted.ms();
  }
  for (int i = 0; i < 2; ++i) {
    clock.advance(settings.rate.period());
    set({}, Duration::microseconds(20));
    genlock.step(clock.now());
  }
  EXPECT_EQ(genlock.state(), GenlockState::kLost);
  EXPECT_EQ(genlock.report().losses, 1u);
}

// Found by the swarm: a head left its trigger and drifted away at 20 ppm, hidden by 0.2 ms of jitter. Sets were
// reported as locked until jitter happened to reveal it; by then they were up to 0.6 ms apart.
TEST_F(GenlockTest, AHeadThatCreepsAway_IsNoticedThroughItsJitterBeforeItIsTheLimitAway) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    hal::sim::Random random(seed, "jitter");
    // 20 ppm at 29.97 frames per second, and 100 ppm at 6.
    settings.rate = seed % 2 == 0 ? FrameRate{} : FrameRate{6, 1};
    const std::int64_t step_ns = seed % 2 == 0 ? 700 : 16'667;
    const auto seen = [&](Duration truth) { return truth + random.around_zero(Duration::microseconds(200)); };
    ASSERT_TRUE(genlock.start(settings, clock.now()));
    std::int64_t creep_ns = 0;
    for (int i = 0; i < 3000; ++i) {
      clock.advance(settings.rate.period());
      while (genlock.take_edge(clock.now())) {}
      if (i > 200) creep_ns += step_ns;
      Skews skews;
      skews.add(0, seen(Duration()));
      skews.add(1, seen(Duration::nanoseconds(creep_ns)));
      set(skews, skews.of[1] - skews.of[0]);
      if (i > 100 && i <= 200) {
        ASSERT_EQ(genlock.state(), GenlockState::kLocked) << "jitter alone is no loss";
      }
      if (creep_ns > 500'000) {
        ASSERT_NE(genlock.state(), GenlockState::kLocked) << creep_ns << " ns away, seed " << seed;
      }
    }
  }
}

// Found by the swarm: after a suspend, the sets exposed before it arrived all at once, locked; the next set, exposed
// after it, when the heads had drifted, was still reported as locked.
TEST_F(GenlockTest, Locked_SetsAfterAGapAreJudgedAnewHoweverManyCameFromBeforeIt) {
  lock();
  const Instant before = clock.now();
  clock.advance(Duration::seconds(10));
  while (genlock.take_edge(clock.now())) {}
  Skews skews;
  skews.add(0, Duration::microseconds(20));
  skews.add(1, Duration::microseconds(40));
  for (int i = 1; i <= 2 * Genlock::kSetsToLock; ++i) {
    exposed = before + settings.rate.period() * i;
    set(skews, Duration::microseconds(20));
  }
  ASSERT_EQ(genlock.state(), GenlockState::kLocked);
  exposed = clock.now();
  set(skews, Duration::microseconds(20));
  EXPECT_NE(genlock.state(), GenlockState::kLocked);
}

TEST_F(GenlockTest, AFreeHeadThatComesBackAfterASecond_IsJudgedByWhereItIsNow) {
  for (const auto away : {Duration::milliseconds(500), Duration::milliseconds(1500)}) {
    hal::sim::Random random(3, "jitter");
    const auto seen = [&] { return random.around_zero(Duration::microseconds(200)); };
    genlock.align(settings.rate, clock.now());
    for (int i = 0; i < 100; ++i) one_period(seen(), seen());
    for (Duration gone; gone < away; gone = gone + settings.rate.period()) one_period(seen(), std::nullopt);
    ASSERT_EQ(genlock.state(), GenlockState::kLocked);
    one_period(Duration(), Duration::microseconds(250));  // counts as jitter if the head returns
    EXPECT_EQ(genlock.state() == GenlockState::kLocked, away < Duration::seconds(1));
  }
}

// Found by the swarm: free-running heads beside pulses with jitter. Their offset stays within the limit for long, but
// they do not follow a late pulse, which is detected after 12 / 0.5 = 24 sets on average: a set adds late^2 / (2
// variance), which is a half when pulses and timestamps have the same deviation.
TEST_F(GenlockTest, AHeadThatRunsFreeBesidePulsesThatJitter_IsNoticedByItsPhaseThatDoesNotFollowThem) {
  constexpr int kTimes = 100, kFollowing = 100, kMax = 500;
  int periods = 0;
  for (std::uint64_t seed = 1; seed <= kTimes; ++seed) {
    hal::sim::TriggerOptions pulses;
    pulses.jitter = Duration::microseconds(200);
    hal::sim::SimTrigger jittery{clock, pulses, seed};
    Genlock follower{&jittery};
    hal::sim::Random random(seed, "timestamps");
    const auto seen = [&](Duration truth) { return truth + random.around_zero(Duration::microseconds(100)); };
    ASSERT_TRUE(follower.start(settings, clock.now()));
    const Instant first = clock.now() + pulses.first_pulse;
    for (int i = 0;; ++i) {
      ASSERT_LT(i, kMax) << "seed " << seed;
      clock.advance(settings.rate.period());
      jittery.step(clock.now());
      std::optional<hal::TriggerEdge> edge;
      while (const auto next = follower.take_edge(clock.now())) edge = next;
      ASSERT_TRUE(edge);
      const Duration late = edge->at - (first + settings.rate.start_of(edge->number));
      Skews skews;
      skews.add(0, seen({}));
      skews.add(1, seen(i < kFollowing ? Duration() : -late));
      FrameSet closed;
      closed.mask = 3;
      closed.mid_exposure = edge->at;
      closed.sync.trigger = edge->number;
      follower.on_set(closed, skews, true, clock.now());
      if (i < kFollowing) {
        ASSERT_TRUE(i < 20 || follower.state() == GenlockState::kLocked) << i << ", seed " << seed;
      } else if (follower.state() == GenlockState::kLost) {
        break;
      } else {
        ++periods;
      }
    }
  }
  EXPECT_NEAR(static_cast<double>(periods) / kTimes, 24, 6);
}

// Found by the swarm: among many heads, one sometimes seems to have 1.5 times the jitter of the others.
TEST_F(GenlockTest, SixteenHeadsThatAllJitter_StayLocked) {
  hal::sim::Random random(5, "jitter");
  ASSERT_TRUE(genlock.start(settings, clock.now()));
  for (int i = 0; i < 30'000; ++i) {
    clock.advance(settings.rate.period());
    while (genlock.take_edge(clock.now())) {}
    Skews skews;
    for (std::size_t head = 0; head < kMaxHeads; ++head)
      skews.add(head, random.around_zero(Duration::microseconds(200)));
    set(skews, {}, (1 << kMaxHeads) - 1);
    genlock.step(clock.now());
  }
  EXPECT_EQ(genlock.state(), GenlockState::kLocked);
  EXPECT_EQ(genlock.report().losses, 0);
}

// Found by the swarm: the heads' return was counted as jitter, which left no margin for as long as the history lasts.
// Lock then takes 11.3 periods on average.
TEST_F(GenlockTest, HeadsThatComeBackFromEitherSide_AreInStepBeforeTheirPastIsOver) {
  constexpr int kTimes = 200;
  int periods = 0;
  for (int time = 1; time <= kTimes; ++time) {
    hal::sim::Random random(static_cast<std::uint64_t>(time), "jitter");
    const auto expose = [&](int apart_us) {  // from the correct position, to either side
      const Duration first = random.around_zero(Duration::microseconds(120)) - Duration::microseconds(apart_us);
      one_period(first, random.around_zero(Duration::microseconds(120)) + Duration::microseconds(apart_us));
    };
    ASSERT_TRUE(genlock.start(settings, clock.now()));
    for (int i = 0; i < 100; ++i) expose(0);
    ASSERT_EQ(genlock.state(), GenlockState::kLocked);
    for (int i = 0; i < 20; ++i) expose(300);
    ASSERT_EQ(genlock.state(), GenlockState::kLost);
    for (int i = 0; i < 100 && genlock.state() != GenlockState::kLocked; ++i, ++periods) expose(0);
  }
  EXPECT_LT(periods, 11 * kTimes);
}

TEST_F(GenlockTest, Locked_NoSetsAnyMoreIsLostWithinThreePeriods) {
  lock();
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(genlock.state(), GenlockState::kLocked) << i;
    clock.advance(settings.rate.period());
    while (genlock.take_edge(clock.now())) {}
    genlock.step(clock.now());
  }
  EXPECT_EQ(genlock.state(), GenlockState::kLost);
}

TEST_F(GenlockTest, Locked_ThePortVanishesIsLostAtOnceAndStaysSo) {
  lock();
  trigger.unplug();
  EXPECT_FALSE(genlock.take_edge(clock.now()));
  EXPECT_EQ(genlock.state(), GenlockState::kLost);
  for (int i = 0; i < 10; ++i) period(Duration::microseconds(20));
  EXPECT_EQ(genlock.state(), GenlockState::kLost);
}

TEST_F(GenlockTest, PulsesThatWereNotSent_AreCounted) {
  lock();
  trigger.lose_pulse();
  trigger.lose_pulse();
  for (int i = 0; i < 4; ++i) period(Duration::microseconds(20));
  EXPECT_EQ(genlock.report().missing, 2u);
}

/// Free-running heads that are nudged: the second head's mid-exposures are later than the first's by a given time.
class AlignedGenlock : public GenlockTest {
 protected:
  void period(Duration apart, Duration moved = {}, HeadMask unresponsive = 0) {
    clock.advance(settings.rate.period());
    FrameSet closed;
    closed.mask = 3;
    closed.mid_exposure = clock.now();
    Skews skews;
    skews.add(0, {});
    skews.add(1, apart, moved);
    genlock.on_set(closed, skews, true, clock.now(), unresponsive);
    genlock.step(clock.now());
  }
  void lock() {
    genlock.align(settings.rate, clock.now());
    for (int i = 0; i < 40; ++i) period(Duration::microseconds(20));
    ASSERT_EQ(genlock.state(), GenlockState::kLocked);
  }
};

TEST_F(AlignedGenlock, GoodSetsInARow_LockWithoutAnyPulse) {
  genlock.align(settings.rate, clock.now());
  EXPECT_EQ(genlock.state(), GenlockState::kAcquiring);
  EXPECT_FALSE(trigger.running());
  for (int i = 0; i < kSetsFromStart; ++i) period(Duration::microseconds(20));
  EXPECT_EQ(genlock.state(), GenlockState::kLocked);
  EXPECT_TRUE(genlock.report().aligned);
}

TEST_F(AlignedGenlock, EstimatesWithinTheSafeLimitByLessThanThreeDeviations_AreLost) {
  OffsetFilter alike;  // the genlock's filter of each head, after that many sets
  alike.restart(0, clock_spec::kTimestampVarianceUs2, clock_spec::kDriftVariancePpm2);
  for (int i = 0; i < 40; ++i) {
    alike.predict(static_cast<double>(settings.rate.period().ns()) / 1e9, clock_spec::kDriftNoisePpm2PerS);
    alike.update(0, clock_spec::kTimestampVarianceUs2);
  }
  const double doubt_us = 3 * std::sqrt(2 * alike.variance_us2());
  const auto most = Genlock::kSafeLimit - Duration::nanoseconds(static_cast<std::int64_t>(doubt_us * 1000));
  for (const bool beyond : {false, true}) {
    lock();
    const Duration apart = most + Duration::microseconds(beyond ? 1 : -1);
    period(apart, apart - Duration::microseconds(20));
    EXPECT_EQ(genlock.state(), beyond ? GenlockState::kLost : GenlockState::kLocked) << apart.us();
  }
}

TEST_F(AlignedGenlock, AHeadMovedByTheRig_IsNotTakenForOneThatCreepsOrJitters) {
  lock();
  for (int i = 0; i < 200; ++i) {
    const Duration to = Duration::microseconds(i % 2 == 0 ? 250 : 20);
    period(to, to - Duration::microseconds(i % 2 == 0 ? 20 : 250));
    ASSERT_EQ(genlock.state(), GenlockState::kLocked) << i;
  }
}

TEST_F(AlignedGenlock, AHeadDoesNotDoWhatItIsAsked_HoldoverForFiveSecondsWhileInStep) {
  lock();
  const Instant begun = clock.now();
  while (genlock.state() == GenlockState::kLocked || genlock.state() == GenlockState::kHoldover) {
    period(Duration::microseconds(20), {}, head_bit(1));
    ASSERT_LT(clock.now() - begun, Duration::seconds(6));
    if (clock.now() - begun < Genlock::kHoldover) {
      ASSERT_EQ(genlock.state(), GenlockState::kHoldover);
    }
  }
  EXPECT_EQ(genlock.state(), GenlockState::kLost);
}

TEST_F(AlignedGenlock, NoSetsAnyMore_IsLostWithinThreePeriods) {
  lock();
  clock.advance(settings.rate.period() * 3 + Duration::milliseconds(1));
  genlock.step(clock.now());
  EXPECT_EQ(genlock.state(), GenlockState::kLost);
}

TEST_F(GenlockTest, Stopped_IsOffWhateverComes) {
  lock();
  genlock.stop();
  period(Duration::microseconds(20));
  EXPECT_EQ(genlock.state(), GenlockState::kOff);
  EXPECT_FALSE(trigger.running());
}

}  // namespace
}  // namespace nodal::firmware
