// Hosts that ask the takes' stage for something that ends later, and are gone before: however many they are.
#include <gtest/gtest.h>

#include <vector>

#include "firmware/record/waiting_tickets.h"
#include "hal/sim/clock.h"
#include "hal/sim/disk.h"
#include "tests/support/take_stage.h"

namespace nodal::firmware {
namespace {

constexpr int kVanished = 80;

/// All but the newest are refused while they wait, the newest have the result.
void expect_newest_answered(const std::vector<TakeAnswer>& answers, int asked) {
  ASSERT_EQ(answers.size(), static_cast<std::size_t>(asked));
  const std::size_t refused = answers.size() - kMaxWaitingTickets;
  for (std::size_t k = 0; k < answers.size(); ++k) {
    EXPECT_EQ(answers[k].ticket, k + 1);
    if (k >= refused) EXPECT_TRUE(answers[k].result) << k;
    else EXPECT_EQ(answers[k].result.error().code, Errc::kOverload) << k;
  }
}

TEST(TakeWaiting, HostsAskForATestOfTheDiskAndAreGone_TheNewestAreAnsweredAndTheRigGoesOn) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  disk.set_speed(&clock, 48'000'000);
  TakeStage stage(disk, clock, TakeStage::large_pictures());
  TakeRequest::TestDisk test;
  test.length = Duration::seconds(10);
  test.heads.assign(TakeStage::kStageHeads, HeadShape{PixelFormat::kGrey8, 320, 240});
  std::vector<TakeAnswer> answers;
  for (int k = 0; k < kVanished; ++k) {
    stage.request(test);
    stage.run(Duration::milliseconds(1));
    if (k >= static_cast<int>(kMaxWaitingTickets)) answers.push_back(stage.next_answer());
  }
  for (std::size_t k = 0; k < kMaxWaitingTickets; ++k) answers.push_back(stage.next_answer());
  expect_newest_answered(answers, kVanished);
  EXPECT_TRUE(stage.start().result);
}

TEST(TakeWaiting, HostsAskToEjectWhileAFileIsReadAndAreGone_TheNewestAreAnswered) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage(disk, clock, {});
  ASSERT_TRUE(stage.in_use().begin_read());
  std::vector<TakeAnswer> answers;
  for (int k = 0; k < kVanished; ++k) {
    stage.request(TakeRequest::Eject{});
    stage.run(Duration::milliseconds(1));
    if (k >= static_cast<int>(kMaxWaitingTickets)) answers.push_back(stage.next_answer());
  }
  stage.in_use().end_read();
  for (std::size_t k = 0; k < kMaxWaitingTickets; ++k) answers.push_back(stage.next_answer());
  expect_newest_answered(answers, kVanished);
}

}  // namespace
}  // namespace nodal::firmware
