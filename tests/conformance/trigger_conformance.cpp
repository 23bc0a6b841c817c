// The tests that every TriggerPort must pass.
#include "trigger_conformance.h"

#include <thread>

namespace nodal::hal {

namespace {

TEST_P(TriggerConformance, NotStarted_NoPulses) { EXPECT_TRUE(edges_during(Duration::seconds(1)).empty()); }

// At 30000/1001 the period is not a whole number of nanoseconds; pulse n must still be at n * 1001 / 30000 s.
TEST_P(TriggerConformance, Started_PulsesCountFromZeroOnTheExactGridOfTheRate) {
  ASSERT_TRUE(trigger().start({}));
  const auto all = edges_during(Duration::seconds(20));
  ASSERT_GE(all.size(), 598U);
  ASSERT_LE(all.size(), 600U);
  for (std::size_t n = 0; n < all.size(); ++n) {
    ASSERT_EQ(all[n].number, n);
    const double exact = static_cast<double>(n) * 1001e9 / 30000;
    const double off = static_cast<double>((all[n].at - all[0].at).ns()) - exact;
    ASSERT_LE(std::abs(off), 2 * static_cast<double>(world_->jitter().ns()) + 2) << "pulse " << n;
  }
}

TEST_P(TriggerConformance, Stopped_NoMorePulsesAndStoppingAgainIsHarmless) {
  trigger().stop();
  ASSERT_TRUE(trigger().start({}));
  edges_during(Duration::milliseconds(500));
  trigger().stop();
  trigger().stop();
  edges();
  EXPECT_TRUE(edges_during(Duration::seconds(1)).empty());
}

TEST_P(TriggerConformance, StartedAgainAtAnotherRate_CountsFromZeroAtThatRate) {
  ASSERT_TRUE(trigger().start({}));
  edges_during(Duration::milliseconds(500));
  TriggerSettings slow;
  slow.rate = {10, 1};
  ASSERT_TRUE(trigger().start(slow));
  const auto all = edges_during(Duration::seconds(2));
  ASSERT_GE(all.size(), 19U);
  ASSERT_LE(all.size(), 21U);
  EXPECT_EQ(all.front().number, 0U);
  EXPECT_EQ(all.back().number, all.size() - 1);
}

TEST_P(TriggerConformance, ImpossibleSettings_AreBadValuesAndARunningTrainGoesOn) {
  ASSERT_TRUE(trigger().start({}));
  edges_during(Duration::milliseconds(100));
  TriggerSettings zero;
  zero.rate = {0, 1};
  TriggerSettings nothing;
  nothing.rate = {30, 0};
  TriggerSettings wide;
  wide.pulse_width = wide.rate.period();
  TriggerSettings none;
  none.pulse_width = {};
  TriggerSettings unreduced;  // products of these terms with nanoseconds exceed 64 bits within seconds
  unreduced.rate = {4'294'967'291, 4'294'967'279};
  TriggerSettings coarse;
  coarse.rate = {2'997'003, 100'000};
  for (const TriggerSettings& settings : {zero, nothing, wide, none, unreduced, coarse}) {
    const Status status = trigger().start(settings);
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, Errc::kBadValue);
    EXPECT_NE(status.error().message.find("trigger"), std::string::npos);
  }
  EXPECT_GE(edges_during(Duration::milliseconds(500)).size(), 14U);
}

// A board that was suspended for ten years at 1000 pulses per second missed 3 * 10^11 pulses.
TEST_P(TriggerConformance, LongPause_TheNewestPulsesComeAndTheStepIsBounded) {
  TriggerSettings fast;
  fast.rate = {1000, 1};
  ASSERT_TRUE(trigger().start(fast));
  const auto before = edges_during(Duration::seconds(1));
  ASSERT_FALSE(before.empty());
  const Duration pause = world_->longest_pause();
  world_->pass(pause);
  const auto after = edges();
  ASSERT_FALSE(after.empty());
  EXPECT_LE(after.size(), 1000U);
  // Still on the grid, and up to now: the newest is at most a period plus the jitter old.
  const std::uint64_t periods = after.back().number - before.back().number;
  EXPECT_GE(periods, static_cast<std::uint64_t>(pause.ms()) - 1);
  EXPECT_LE(periods, static_cast<std::uint64_t>(pause.ms()) + 1);
  const std::int64_t off = (after.back().at - before.back().at).ns() - static_cast<std::int64_t>(periods) * 1'000'000;
  EXPECT_LE(std::abs(off), 2 * world_->jitter().ns());
}

// While the port's stage may hang in a call, another thread ends the program.
TEST_P(TriggerConformance, MadeSafeByAnotherThread_NoPulseComesAnyMoreAndNothingStartsItAgain) {
  ASSERT_TRUE(trigger().start({}));
  edges_during(Duration::milliseconds(500));
  std::thread another([&] { trigger().make_safe(); });
  for (int i = 0; i < 1000; ++i) {
    if (const auto edge = trigger().take_edge(); !edge) {
      EXPECT_EQ(edge.error().code, Errc::kDeviceGone);
    }
  }
  another.join();
  world_->pass(Duration::seconds(1));
  EXPECT_EQ(trigger().take_edge().error().code, Errc::kDeviceGone);
  EXPECT_EQ(trigger().start({}).error().code, Errc::kDeviceGone);
  trigger().make_safe();
  trigger().stop();
  EXPECT_EQ(trigger().take_edge().error().code, Errc::kDeviceGone);
}

}  // namespace
}  // namespace nodal::hal
