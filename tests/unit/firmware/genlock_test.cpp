#include "firmware/genlock.h"

#include <gtest/gtest.h>

#include "hal/sim/clock.h"
#include "hal/sim/trigger.h"

namespace nodal::firmware {
namespace {

class GenlockTest : public testing::Test {
 protected:
  /// A period goes by, with a set at its end whose first exposure began `latency` after its pulse, and its last so
  /// much later; nothing: no pulse exposed it.
  void period(std::optional<Duration> apart, Duration latency = Duration::microseconds(20)) {
    clock.advance(settings.rate.period());
    while (genlock.take_edge()) {
    }
    FrameSet set;
    set.sync.spread = Duration::microseconds(30);
    std::optional<Skews> skews;
    if (apart) skews = Skews{latency, latency + *apart};
    genlock.on_set(set, skews, true, clock.now());
    genlock.step(clock.now());
  }
  void lock() {
    ASSERT_TRUE(genlock.start(settings, clock.now()));
    for (int i = 0; i < 2 * Genlock::kSetsToLock; ++i) period(Duration::microseconds(20));
    ASSERT_EQ(genlock.state(), GenlockState::kLocked);
  }

  hal::sim::SimClock clock;
  hal::sim::SimTrigger trigger{clock, {}, 1};
  hal::TriggerSettings settings;
  Genlock genlock{&trigger};
};

TEST_F(GenlockTest, WithoutATriggerPort_StartSaysSo) {
  Genlock none(nullptr);
  const Status started = none.start(settings, clock.now());
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().code, Errc::kNoSuchDevice);
  EXPECT_EQ(none.state(), GenlockState::kOff);
}

TEST_F(GenlockTest, GoodSetsInARow_Lock) {
  ASSERT_TRUE(genlock.start(settings, clock.now()));
  for (int i = 0; i < Genlock::kSetsToLock; ++i) {
    EXPECT_EQ(genlock.state(), GenlockState::kAcquiring);
    period(Duration::microseconds(20));
  }
  EXPECT_EQ(genlock.state(), GenlockState::kLocked);
  EXPECT_EQ(genlock.report().spread_worst, Duration::microseconds(30));
}

TEST_F(GenlockTest, ABadSetInBetween_CountsAnew) {
  ASSERT_TRUE(genlock.start(settings, clock.now()));
  for (int i = 0; i < 10; ++i) {
    for (int good = 0; good < Genlock::kSetsToLock - 1; ++good) period(Duration::microseconds(499));
    period(Duration::microseconds(501));
    EXPECT_EQ(genlock.state(), GenlockState::kAcquiring);
  }
}

TEST_F(GenlockTest, Locked_OneSetOffIsLostAtOnce) {
  lock();
  period(Duration::microseconds(501));
  EXPECT_EQ(genlock.state(), GenlockState::kLost);
  for (int i = 0; i < Genlock::kSetsToLock; ++i) period(Duration::microseconds(20));
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

TEST_F(GenlockTest, Locked_ASetThatNoPulseExposedIsLost) {
  lock();
  period(std::nullopt);
  EXPECT_EQ(genlock.state(), GenlockState::kLost);
}

TEST_F(GenlockTest, Locked_NoSetsAnyMoreIsLostWithinThreePeriods) {
  lock();
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(genlock.state(), GenlockState::kLocked) << i;
    clock.advance(settings.rate.period());
    while (genlock.take_edge()) {
    }
    genlock.step(clock.now());
  }
  EXPECT_EQ(genlock.state(), GenlockState::kLost);
}

TEST_F(GenlockTest, Locked_ThePortVanishesIsLostAtOnceAndStaysSo) {
  lock();
  trigger.unplug();
  EXPECT_FALSE(genlock.take_edge());
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

TEST_F(GenlockTest, Stopped_IsOffWhateverComes) {
  lock();
  genlock.stop();
  period(Duration::microseconds(20));
  EXPECT_EQ(genlock.state(), GenlockState::kOff);
  EXPECT_FALSE(trigger.running());
}

}  // namespace
}  // namespace nodal::firmware
