// Hosts that ask the takes' stage for something that ends later, and are gone before: however many they are, their
// requests take no place from others.
#include <gtest/gtest.h>

#include <vector>

#include "firmware/record/waiting_tickets.h"
#include "hal/sim/clock.h"
#include "hal/sim/disk.h"
#include "tests/support/take_stage.h"

namespace nodal::firmware {
namespace {

constexpr int kVanished = 80;

TakeRequest::TestDisk a_test(Duration length = Duration::seconds(10)) {
  TakeRequest::TestDisk test;
  test.length = length;
  test.heads.assign(TakeStage::kStageHeads, HeadShape{PixelFormat::kGrey8, 320, 240});
  return test;
}

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

TEST(TakeWaiting, MoreHostsThanThereMayBeAskForATestOfTheDisk_TheNewestAreAnsweredAndTheRigGoesOn) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  disk.set_speed(&clock, 48'000'000);
  TakeStage stage(disk, clock, TakeStage::large_pictures());
  std::vector<TakeAnswer> answers;
  for (int k = 0; k < kVanished; ++k) {
    stage.request(a_test());
    stage.run(Duration::milliseconds(1));
    if (k >= static_cast<int>(kMaxWaitingTickets)) answers.push_back(stage.next_answer());
  }
  for (std::size_t k = 0; k < kMaxWaitingTickets; ++k) answers.push_back(stage.next_answer());
  expect_newest_answered(answers, kVanished);
  EXPECT_TRUE(stage.start().result);
}

TEST(TakeWaiting, MoreHostsThanThereMayBeAskToEjectWhileAFileIsRead_TheNewestAreAnswered) {
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

TEST(TakeWaiting, HostsAskForTestsOfTheDiskAndAreGone_TheOneThatWaitsGetsTheResult) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  disk.set_speed(&clock, 48'000'000);
  TakeStage stage(disk, clock, TakeStage::large_pictures());
  stage.request(a_test());  // the first; it stays
  for (int k = 0; k < kVanished; ++k) {
    const Presence host = Presence::of_host();
    stage.request(a_test(), host);
    stage.run(Duration::milliseconds(1));
    host.end();
  }
  int dropped = 0;
  TakeAnswer answer = stage.next_answer();
  for (; answer.ticket != 1; answer = stage.next_answer(), ++dropped) {
    ASSERT_FALSE(answer.result);
    ASSERT_EQ(answer.result.error().code, Errc::kCancelled) << answer.ticket;
  }
  EXPECT_EQ(dropped, kVanished);
  ASSERT_TRUE(answer.result) << answer.result.error().message;
  EXPECT_GE(std::get<TakeAnswer::DiskTested>(*answer.result).speed.took, Duration::seconds(10));
}

TEST(TakeWaiting, TheLastHostThatWaitsForATestOfTheDiskIsGone_TheTestEnds) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  disk.set_speed(&clock, 48'000'000);
  TakeStage stage(disk, clock, TakeStage::large_pictures());
  const Presence first = Presence::of_host(), second = Presence::of_host();
  stage.request(a_test(Duration::seconds(60)), first);
  stage.run(Duration::seconds(1));
  stage.request(a_test(Duration::seconds(60)), second);
  first.end();
  stage.run(Duration::seconds(1));
  EXPECT_TRUE(stage.report().test_percent) << "the second still waits";
  second.end();
  stage.run(Duration::seconds(1));
  EXPECT_FALSE(stage.report().test_percent);
  EXPECT_FALSE(disk.size(DiskTest::kFile));
}

TEST(TakeWaiting, RequestsOfHostsThatAreGoneFillTheQueue_NoneIsCarriedOutAndTheNextIsAnsweredInOneStep) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage(disk, clock, {});
  const Presence gone = Presence::of_host();
  for (int k = 0; k < 60; ++k) stage.request(stage.start_request(), gone);
  gone.end();
  stage.request(TakeRequest::List{});
  stage.run(Duration::milliseconds(1));
  for (std::uint64_t k = 1; k <= 60; ++k) {
    const TakeAnswer answer = stage.next_answer();
    ASSERT_EQ(answer.ticket, k);
    ASSERT_FALSE(answer.result);
    EXPECT_EQ(answer.result.error().code, Errc::kCancelled);
  }
  const TakeAnswer listed = stage.next_answer();
  ASSERT_TRUE(listed.result);
  EXPECT_TRUE(std::get<TakeAnswer::Listed>(*listed.result).takes.empty());
}

TEST(TakeWaiting, TheHostThatEjectsIsGoneWhileAFileIsRead_TheDiskIsEjectedAllTheSame) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage(disk, clock, {});
  ASSERT_TRUE(stage.in_use().begin_read());
  const Presence host = Presence::of_host();
  stage.request(TakeRequest::Eject{}, host);
  stage.run(Duration::milliseconds(1));
  host.end();
  stage.run(Duration::seconds(1));
  EXPECT_FALSE(stage.report().ejected);
  stage.in_use().end_read();
  stage.run(Duration::seconds(1));
  EXPECT_TRUE(stage.report().ejected);
}

}  // namespace
}  // namespace nodal::firmware
