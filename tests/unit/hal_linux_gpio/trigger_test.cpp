// Pulses sent by the trigger's thread.
#include "gpio_fixture.h"

namespace nodal::hal::gpio {
namespace {

using GpioTriggerTest = GpioTest;

TEST_F(GpioTriggerTest, Pulse_HasTheWidthAndThePolarityOfItsSettings) {
  for (const bool active_high : {true, false}) {
    lines_ = {};
    lines_.active_high = active_high;
    add_output(active_high ? 17 : 18, {0});
    open();
    TriggerSettings settings;
    settings.active_high = active_high;
    settings.pulse_width = Duration::microseconds(250);
    start(settings);
    edges_during(Duration::seconds(1));
    trigger_.reset();
    auto begins = changes(active_high ? 17 : 18, active_high);
    auto ends = changes(active_high ? 17 : 18, !active_high);
    if (!active_high) ends.erase(ends.begin());  // claimed at its inactive level
    else ASSERT_EQ(begins.size(), 30U);
    ASSERT_EQ(begins.size(), ends.size()) << active_high;
    for (std::size_t i = 0; i < begins.size(); ++i) EXPECT_EQ((ends[i] - begins[i]).us(), 250);
  }
}

TEST_F(GpioTriggerTest, HeadsWithDifferentDelays_EachLinePulsesAtItsOwnTimeAndTheTriggerIsReported) {
  add_output(17, {0, 2});
  add_output(18, {1});
  open();
  TriggerSettings settings;
  settings.delay[0] = settings.delay[2] = Duration::microseconds(700);
  settings.delay[1] = Duration::microseconds(200);
  start(settings);
  const auto all = edges_during(Duration::seconds(1));
  const auto first = changes(17, true);
  const auto second = changes(18, true);
  ASSERT_EQ(first.size(), 30U);
  ASSERT_EQ(second.size(), 30U);
  ASSERT_EQ(all.size(), 30U);
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ((first[i] - all[i].at).us(), 700);
    EXPECT_EQ((second[i] - all[i].at).us(), 200);
  }
}

TEST_F(GpioTriggerTest, HeadsOfOneLineWithDifferentDelays_AreRefusedWithTheLineAndTheDelays) {
  add_output(17, {0, 1});
  open();
  TriggerSettings settings;
  settings.delay[1] = Duration::microseconds(200);
  const Status status = trigger_->start(settings);
  ASSERT_FALSE(status);
  expect_says(status.error(), Errc::kBadValue, {"trigger", "gpio:gpiochip0:17", "heads 0 and 1", "0 and 200 us"});
}

TEST_F(GpioTriggerTest, ThreadWakesALittleLate_PulsesAreSentWithTheirTrueTimes) {
  add_output(17, {0});
  open();
  chips_.lateness = [wake = 0]() mutable { return Duration::microseconds(100 * (wake++ % 5)); };
  start({});
  const auto all = edges_during(Duration::seconds(2));
  const auto sent = changes(17, true);
  ASSERT_EQ(all.size(), 60U);
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(all[i].at, sent[i]);
    const Instant exact = Instant::from_ns(1'001'000'000) + FrameRate{}.start_of(i);
    EXPECT_LE((all[i].at - exact).us(), 400) << i;
  }
  EXPECT_EQ(trigger_->counts(), TriggerCounts{});
  EXPECT_EQ(trigger_->latest().us(), 400);
}

TEST_F(GpioTriggerTest, ThreadWakesTooLate_ThePulseIsNotSentIsCountedAndTheGridStays) {
  add_output(17, {0});
  open();
  start({});
  edges_during(Duration::seconds(1));
  chips_.lateness = [] { return Duration::milliseconds(9); };  // a quarter of a period is 8.3 ms
  edges_during(Duration::milliseconds(200));
  chips_.lateness = nullptr;
  const auto all = edges_during(Duration::seconds(1));
  ASSERT_FALSE(all.empty());
  const TriggerCounts counts = trigger_->counts();
  EXPECT_GE(counts.late, 5U);
  EXPECT_EQ(changes(17, true).size() + counts.late, all.back().number + 1);
  const Instant exact = Instant::from_ns(1'001'000'000) + FrameRate{}.start_of(all.back().number);
  EXPECT_LE((all.back().at - exact).ns(), 1);
}

// At 1000 pulses per second with writes of 0.8 ms, the thread cannot keep up.
TEST_F(GpioTriggerTest, RateTooHighForTheLine_EveryPulseIsSentOrCounted) {
  add_output(17, {0});
  open();
  chips_.write_time = Duration::microseconds(800);
  TriggerSettings fast;
  fast.rate = {1000, 1};
  start(fast);
  const auto all = edges_during(Duration::seconds(1));
  ASSERT_FALSE(all.empty());
  EXPECT_GT(trigger_->counts().late, 100U);
  // Pulses after the newest edge are already counted.
  EXPECT_GE(all.size() + trigger_->counts().late, all.back().number + 1);
  EXPECT_LE(all.size() + trigger_->counts().late, all.back().number + 2);
}

TEST_F(GpioTriggerTest, WidthThatLeavesNoGap_IsABadValue) {
  add_output(17, {0});
  open();
  TriggerSettings settings;
  settings.rate = {1000, 1};
  settings.pulse_width = Duration::microseconds(901);
  const Status status = trigger_->start(settings);
  ASSERT_FALSE(status);
  expect_says(status.error(), Errc::kBadValue, {"901 us", "1000 us", "100 us"});
}

TEST_F(GpioTriggerTest, NobodyTakesEdges_TheNewestAreKept) {
  add_output(17, {0});
  open();
  TriggerSettings fast;
  fast.rate = {1000, 1};
  start(fast);
  chips_.pass(Duration::seconds(2));
  const auto all = edges();
  ASSERT_EQ(all.size(), EdgeLog::kKept);
  EXPECT_EQ(all.back().number, 1999U);
  EXPECT_EQ(all.front().number, 2000 - EdgeLog::kKept);
}

TEST_F(GpioTriggerTest, Running_TheThreadWakesTwiceAPulseAndNotWhenStopped) {
  add_output(17, {0});
  open();
  start({});
  const auto before = chips_.steps();
  chips_.pass(Duration::seconds(10));
  EXPECT_LE(chips_.steps() - before, 601U);
  trigger_->stop();
  const auto stopped = chips_.steps();
  chips_.pass(Duration::seconds(10));
  EXPECT_EQ(chips_.steps(), stopped);
}

TEST_F(GpioTriggerTest, StoppedOrDestroyedDuringAPulse_TheLineIsInactive) {
  add_output(17, {0});
  open();
  TriggerSettings wide;
  wide.pulse_width = Duration::milliseconds(20);
  start(wide);
  chips_.pass(Duration::milliseconds(5));
  ASSERT_TRUE(chips_.wire(line(17)));
  trigger_->stop();
  EXPECT_FALSE(chips_.wire(line(17)));
  start(wide);
  chips_.pass(Duration::milliseconds(5));
  ASSERT_TRUE(chips_.wire(line(17)));
  trigger_.reset();
  EXPECT_FALSE(chips_.wire(line(17)));
  EXPECT_EQ(chips_.claimed(), 0);
}

// At the slowest rate a period is 1000 s; the clock is near its maximum.
TEST_F(GpioTriggerTest, SlowestRateAndALateClock_PulsesComeInTime) {
  chips_.suspend(Duration::nanoseconds(INT64_MAX / 2));
  add_output(17, {0});
  open();
  TriggerSettings slow;
  slow.rate = {1, 1000};
  start(slow);
  const auto all = edges_during(Duration::seconds(3001));
  ASSERT_EQ(all.size(), 4U);
  EXPECT_EQ((all[3].at - all[0].at), Duration::seconds(3000));
}

TEST_F(GpioTriggerTest, ReadBack_PulsesHaveTheTimesOfTheSecondLine) {
  add_output(17, {0});
  lines_.read_back = line(27);
  chips_.connect(line(17), line(27));
  chips_.stamp = [](Instant at) { return at + Duration::microseconds(30); };
  open();
  TriggerSettings settings;
  settings.delay[0] = Duration::microseconds(500);
  start(settings);
  const auto all = edges_during(Duration::seconds(1));
  const auto sent = changes(17, true);
  ASSERT_EQ(all.size(), sent.size());
  for (std::size_t i = 0; i < all.size(); ++i) EXPECT_EQ((all[i].at - sent[i]).us(), 30 - 500);
  EXPECT_EQ(trigger_->counts(), TriggerCounts{});
}

TEST_F(GpioTriggerTest, ReadBackIsNotWired_NoPulseIsReportedAndEachIsCountedAsUnseen) {
  add_output(17, {0});
  lines_.read_back = line(27);
  open();
  start({});
  EXPECT_TRUE(edges_during(Duration::seconds(1)).empty());
  EXPECT_GE(trigger_->counts().unseen, 29U);
  for (int i = 0; i < 4; ++i) chips_.drive(line(27), i % 2 == 0);  // noise while no pulse is sent
  EXPECT_TRUE(edges_during(Duration::milliseconds(500)).size() <= 1);
}

}  // namespace
}  // namespace nodal::hal::gpio
