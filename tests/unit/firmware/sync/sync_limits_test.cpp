// The genlock and the drift meter at the limits that their headers state.
#include <gtest/gtest.h>

#include "firmware/sync/drift.h"
#include "firmware/sync/genlock.h"
#include "hal/sim/clock.h"
#include "hal/sim/trigger.h"

namespace nodal::firmware {
namespace {

/// Two heads that follow the pulses. The second one's exposure has another length, so that its middle is later.
class GenlockLimits : public testing::Test {
 protected:
  void advance(Duration by) {
    clock.advance(by);
    trigger.step(clock.now());
    while (const auto edge = genlock.take_edge(clock.now())) newest = *edge;
  }
  /// A set of both heads; without `pulse_seen`, no pulse is known to have exposed it.
  void set(Duration second_later, bool pulse_seen = true) {
    FrameSet closed;
    closed.mask = 3;
    closed.sync.offset[1] = second_later;
    closed.mid_exposure = clock.now();
    if (newest) closed.sync.trigger = newest->number;
    Skews skews;
    if (pulse_seen) {
      skews.add(0, Duration::microseconds(20));
      skews.add(1, Duration::microseconds(20));
    }
    genlock.on_set(closed, skews, true, clock.now());
  }
  void periods(int count, Duration second_later = {}, bool pulse_seen = true) {
    for (int i = 0; i < count; ++i) {
      advance(settings.rate.period());
      set(second_later, pulse_seen);
    }
  }
  void lock(Duration second_later = {}) {
    ASSERT_TRUE(genlock.start(settings, clock.now()));
    periods(Genlock::kSetsToLock + 1, second_later);
    ASSERT_EQ(genlock.state(), GenlockState::kLocked);
  }

  hal::sim::SimClock clock;
  hal::sim::TriggerOptions options;
  hal::sim::SimTrigger trigger{clock, options, 1};
  hal::TriggerSettings settings;
  Genlock genlock{&trigger};
  std::optional<hal::TriggerEdge> newest;
};

TEST_F(GenlockLimits, GoodSetsAroundABadOne_DoNotAddUp) {
  ASSERT_TRUE(genlock.start(settings, clock.now()));
  periods(Genlock::kSetsToLock);  // the first one after a start is never good
  periods(1, Duration(), false);  // nothing is known of this one
  periods(Genlock::kSetsToLock - 1);
  EXPECT_EQ(genlock.state(), GenlockState::kAcquiring);
  periods(1);
  EXPECT_EQ(genlock.state(), GenlockState::kLocked);
}

TEST_F(GenlockLimits, TwoAndAHalfPeriodsWithoutAPulse_AreTheMost) {
  lock();
  const Instant last = newest->at;
  genlock.step(last + settings.rate.period() * 5 / 2);
  EXPECT_EQ(genlock.state(), GenlockState::kLocked);
  genlock.step(last + settings.rate.period() * 5 / 2 + Duration::nanoseconds(1));
  EXPECT_EQ(genlock.state(), GenlockState::kHoldover);
}

TEST_F(GenlockLimits, Holdover_HeadsAreComparedWithWhereTheyWereInLock) {
  lock(Duration::milliseconds(2));
  periods(6, Duration::microseconds(2300));
  // The mean of 16 sets: 2.3 ms - 0.3 ms (15/16)^6 = 2.096 ms.
  periods(1, Duration::microseconds(2550), false);
  EXPECT_EQ(genlock.state(), GenlockState::kHoldover) << "0.45 ms from the mean";
  periods(1, Duration::microseconds(2650), false);
  EXPECT_EQ(genlock.state(), GenlockState::kLost) << "0.55 ms from the mean";
}

// 1.5 ms of jitter is more than the limit; heads that follow the pulses jitter with them, and so not relative to them.
TEST_F(GenlockLimits, PulsesThatJitter_HeadsThatFollowThemStayLocked) {
  options.jitter = Duration::microseconds(1500);
  hal::sim::SimTrigger jittery{clock, options, 3};
  Genlock follower{&jittery};
  ASSERT_TRUE(follower.start(settings, clock.now()));
  for (int i = 0; i < 300; ++i) {
    clock.advance(settings.rate.period());
    jittery.step(clock.now());
    while (const auto edge = follower.take_edge(clock.now())) newest = *edge;
    if (!newest) continue;
    FrameSet closed;
    closed.mask = 3;
    closed.mid_exposure = newest->at + Duration::milliseconds(4);
    closed.sync.trigger = newest->number;
    Skews skews;
    skews.add(0, Duration::microseconds(20));
    skews.add(1, Duration::microseconds(20));
    follower.on_set(closed, skews, true, clock.now());
    EXPECT_EQ(follower.state(), i > 10 ? GenlockState::kLocked : follower.state()) << i;
  }
  EXPECT_EQ(follower.report().losses, 0u);
}

TEST(DriftMeterLimits, AJumpOfHalfAPeriod_IsMeasuredAndAlargerOneStartsAgain) {
  const FrameRate rate{25, 1};
  for (const std::int64_t more : {0, 1}) {
    DriftMeter meter;
    meter.restart(rate);
    const int count = 3 * static_cast<int>(DriftMeter::kBlockPeriods);
    const auto at = [&](int n) { return Instant::from_ns(1'000) + rate.start_of(static_cast<std::uint64_t>(n)); };
    for (int n = 0; n < count; ++n) meter.add(n, at(n));
    EXPECT_EQ(meter.ppb(), 0);
    meter.add(count, at(count) + Duration::nanoseconds(rate.period().ns() / 2 + more));
    EXPECT_EQ(meter.ppb().has_value(), more == 0);
  }
}

}  // namespace
}  // namespace nodal::firmware
