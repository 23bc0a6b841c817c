// Pulses of another device: their numbers, and the counters of lost and extra pulses.
#include <numeric>

#include "gpio_fixture.h"

namespace nodal::hal::gpio {
namespace {

class GpioInputTest : public GpioTest {
 protected:
  GpioInputTest() {
    lines_.input = line(5);
    open();
    TriggerSettings follow;
    follow.follow = true;
    follow.rate = {25, 1};
    start(follow);
    chips_.pass(Duration::milliseconds(2));
  }
  void pulse() {
    chips_.drive(line(5), true);
    chips_.pass(Duration::milliseconds(1));
    chips_.drive(line(5), false);
  }
  /// A pulse, and the rest of its 40 ms period.
  void period() {
    pulse();
    chips_.pass(Duration::milliseconds(39));
  }
  std::vector<std::uint64_t> numbers() {
    std::vector<std::uint64_t> all;
    for (const TriggerEdge& edge : edges()) all.push_back(edge.number);
    return all;
  }
};

using Numbers = std::vector<std::uint64_t>;

TEST_F(GpioInputTest, RegularPulses_AreNumberedFromZeroWithTheKernelsTimes) {
  for (int i = 0; i < 10; ++i) period();
  const auto all = edges();
  ASSERT_EQ(all.size(), 10U);
  for (std::size_t i = 0; i < 10; ++i) {
    EXPECT_EQ(all[i].number, i);
    EXPECT_EQ(all[i].at, Instant::from_ns(1'002'000'000) + Duration::milliseconds(40) * static_cast<std::int64_t>(i));
  }
  EXPECT_EQ(trigger_->counts(), TriggerCounts{});
}

TEST_F(GpioInputTest, MissingPulses_LeaveAGapAndAreLost) {
  period();
  chips_.pass(Duration::milliseconds(80));
  period();
  EXPECT_EQ(numbers(), (Numbers{0, 3}));
  TriggerCounts lost;
  lost.lost = 2;
  EXPECT_EQ(trigger_->counts(), lost);
}

TEST_F(GpioInputTest, DoubledPulse_IsDiscardedWhereverItIsInThePeriod) {
  std::vector<TriggerEdge> all;
  const auto take = [&] {
    for (const TriggerEdge& edge : edges()) all.push_back(edge);
  };
  for (int at_ms = 2; at_ms < 38; at_ms += 5) {
    period();
    pulse();
    chips_.pass(Duration::milliseconds(at_ms));
    pulse();
    chips_.pass(Duration::milliseconds(40 - 2 - at_ms));
    take();
  }
  period();
  take();
  // A pulse up to an eighth of a period early replaces the true one, which is then discarded.
  EXPECT_EQ(all.back().number, all.size() - 1);
  EXPECT_EQ(all.size(), 2 * 8 + 1U);
  EXPECT_EQ(trigger_->counts().doubled, 8U);
  EXPECT_EQ(trigger_->counts().lost, 0U);
  EXPECT_EQ(trigger_->counts().jumps, 0U);
}

TEST_F(GpioInputTest, QueueWasFull_WhatIsMissingIsAnOverrunAndNotLost) {
  TriggerCounts overrun;
  for (const bool oldest : {false, true}) {
    chips_.discards_oldest = oldest;
    const std::uint64_t before = chips_.discarded_edges();
    period();
    const Numbers first = numbers();
    ASSERT_EQ(first.size(), 1U);
    for (int i = 0; i < 20; ++i) period();  // the edges are not taken
    EXPECT_EQ(chips_.discarded_edges() - before, 4U);
    Numbers kept(16);
    std::iota(kept.begin(), kept.end(), first[0] + (oldest ? 5 : 1));
    EXPECT_EQ(numbers(), kept);
    period();
    EXPECT_EQ(numbers(), Numbers{first[0] + 21});
    overrun.overrun += 4;
    EXPECT_EQ(trigger_->counts(), overrun);
  }
}

TEST_F(GpioInputTest, SourceContinuesWithAnotherPhase_ItIsFollowedAfterThreePulses) {
  for (int i = 0; i < 5; ++i) period();
  chips_.pass(Duration::milliseconds(18));
  for (int i = 0; i < 5; ++i) period();
  const auto all = edges();
  ASSERT_EQ(all.size(), 8U);
  for (std::size_t i = 1; i < all.size(); ++i) EXPECT_GT(all[i].number, all[i - 1].number);
  EXPECT_EQ(trigger_->counts().jumps, 1U);
  EXPECT_EQ(trigger_->counts().doubled, 2U);
}

// 300 ppm of drift and +-2 ms of jitter.
TEST_F(GpioInputTest, DriftAndJitter_NothingIsLostOrDoubled) {
  std::uint32_t random = 1;
  Duration jitter;
  std::size_t seen = 0;
  for (int i = 0; i < 2000; ++i) {
    random = random * 1'664'525 + 1'013'904'223;
    const Duration next = Duration::microseconds(static_cast<std::int64_t>(random >> 16) * 4'000 / 65'536);
    chips_.pass(Duration::microseconds(40'012 - 1'000) + next - jitter);
    jitter = next;
    pulse();
    seen += edges().size();
  }
  EXPECT_EQ(seen, 2000U);
  EXPECT_EQ(trigger_->counts(), TriggerCounts{});
}

TEST_F(GpioInputTest, TimestampsOfTheWallClock_AreRefused) {
  chips_.stamp = [](Instant) { return Instant::from_ns(1'700'000'000'000'000'000); };
  period();
  const auto edge = trigger_->take_edge();
  ASSERT_FALSE(edge);
  expect_says(edge.error(), Errc::kUnsupported, {"gpio:gpiochip0:5", "Linux 5.7"});
}

TEST_F(GpioInputTest, TimestampsBeforeTheStart_AreOfNoPulse) {
  chips_.stamp = [](Instant) { return Instant::from_ns(-5); };
  period();
  EXPECT_TRUE(edges().empty());
}

TEST_F(GpioInputTest, ChipGone_IsReported) {
  chips_.unplug("gpiochip0");
  const auto edge = trigger_->take_edge();
  ASSERT_FALSE(edge);
  expect_says(edge.error(), Errc::kDeviceGone, {"gpio:gpiochip0:5"});
}

TEST_F(GpioInputTest, AskedToDrive_IsUnsupportedBecauseTheLineIsAnInput) {
  const Status status = trigger_->start({});
  ASSERT_FALSE(status);
  expect_says(status.error(), Errc::kUnsupported, {"input", "source"});
}

}  // namespace
}  // namespace nodal::hal::gpio
