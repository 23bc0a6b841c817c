// A day of recording in a loop, in virtual time.
#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "firmware/record/recording.h"
#include "hal/sim/clock.h"
#include "hal/sim/disk.h"
#include "tests/support/take_account.h"
#include "tests/support/take_stage.h"

namespace nodal::firmware {
namespace {

std::size_t heap_bytes() {
  const struct mallinfo2 now = mallinfo2();
  return now.uordblks + now.hblkhd;
}

TakeStage::Options in_a_loop() {
  TakeStage::Options options;
  options.takes.loop = true;
  return options;
}

/// Room for `bytes` of takes beside what the stage keeps free.
std::uint64_t capacity_for(std::uint64_t bytes) {
  return 2 * Recording::kReserveBytes + (std::uint64_t{16} << 20) + bytes;
}

TEST(LoopDay, ADiskOfAnHour_IsBoundedUnbrokenAndKeepsTheMarks) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk(1, capacity_for(40'000'000));
  TakeStage stage(disk, clock, in_a_loop());
  ASSERT_TRUE(stage.start().result);  // take 1, which goes
  stage.run(Duration::seconds(300));
  ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  ASSERT_TRUE(stage.start().result);  // take 2, protected
  stage.run(Duration::seconds(100));
  ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  ASSERT_TRUE(stage.ask(TakeRequest::Protect{2, true}).result);
  ASSERT_TRUE(stage.start(true).result);  // take 3, a still
  ASSERT_TRUE(stage.start().result);      // take 4: the day

  constexpr int kHours = 24;
  std::uint64_t least_free = ~std::uint64_t{0}, marked = 0;
  std::size_t heap_early = 0, heap_most = 0;
  for (int minute = 0; minute < kHours * 60; ++minute) {
    stage.run(Duration::seconds(60));
    least_free = std::min(least_free, disk.free_bytes().value());
    if (minute == 150) {
      marked = stage.report().sets;
      ASSERT_TRUE(stage.ask(TakeRequest::Mark{"here"}).result);
    }
    if (minute < 4 * 60) heap_early = std::max(heap_early, heap_bytes());
    else heap_most = std::max(heap_most, heap_bytes());
  }
  EXPECT_EQ(stage.report().problem, "");
  EXPECT_EQ(stage.report().lost_sets, 0U);
  ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  EXPECT_GE(least_free, Recording::kReserveBytes);
  EXPECT_LT(heap_most, heap_early + (std::size_t{4} << 20));

  std::map<std::uint64_t, TakeEntry> takes;
  for (const TakeEntry& entry : stage.list()) takes[entry.number] = entry;
  EXPECT_FALSE(takes.contains(1)) << "the oldest goes first";
  EXPECT_EQ(takes.at(2).sets, account_of(disk, 2).sets);
  EXPECT_EQ(takes.at(2).deleted_sets, 0U);
  EXPECT_EQ(takes.at(3).sets, 1U);
  const TakeEntry& day = takes.at(4);
  const TakeAccount account = account_of(disk, 4);
  EXPECT_EQ(day.state, TakeState::kComplete);
  EXPECT_EQ(account.sets, day.sets);
  EXPECT_EQ(account.missed + account.cut, 0U);
  EXPECT_EQ(account.end, day.sets + day.deleted_sets);
  EXPECT_NEAR(static_cast<double>(account.end), kHours * 3600 * 5, 20);
  EXPECT_GT(day.deleted_sets, 20U * 3600 * 5) << "the disk has room for less than four hours";
  EXPECT_GT(day.sets, 3600U * 5 / 2) << "and for half an hour at least";
  constexpr std::uint64_t kMinute = 60 * 5;
  for (const std::uint64_t set : {marked - kMinute, marked, marked + kMinute}) {
    EXPECT_TRUE(std::ranges::any_of(account.segments, [&](const auto& s) { return s.first <= set && set < s.second; }))
        << set << " is within a minute of the mark";
  }
  EXPECT_FALSE(std::ranges::any_of(account.segments, [&](const auto& s) {
    return s.first <= marked + 4 * kMinute && marked + 4 * kMinute < s.second;
  }));
}

TEST(LoopDay, ACardOfLessThanTwoSegments_IsRefusedAndOneOfMoreNeverEnds) {
  TakeStage::Options options = TakeStage::large_pictures();  // 4.6 MB/s
  options.takes.loop = true;
  constexpr std::uint64_t kSecond = 2 * 320 * 240 * 30;
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk(1, 2 * Recording::kReserveBytes + 140 * kSecond);
  TakeStage stage(disk, clock, options);
  const auto refused = stage.start();
  ASSERT_FALSE(refused.result);
  EXPECT_EQ(refused.result.error().code, Errc::kDiskFull);
  disk.set_capacity(2 * Recording::kReserveBytes + 155 * kSecond);
  ASSERT_TRUE(stage.start().result);
  stage.run(Duration::seconds(600));
  EXPECT_TRUE(stage.report().recording) << stage.report().problem;
  EXPECT_GT(stage.report().deleted_segments, 5U);
  EXPECT_EQ(stage.report().lost_sets, 0U);
}

TEST(LoopDay, WhenNothingMayBeDeleted_TheTakeEndsAndSaysWhy) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk(1, capacity_for(2'000'000));
  TakeStage stage(disk, clock, in_a_loop());
  ASSERT_TRUE(stage.start().result);
  for (int minute = 0; minute < 240 && stage.report().recording; ++minute) {
    (void)stage.ask(TakeRequest::Mark{"again"});
    stage.run(Duration::seconds(60));
  }
  // The reserve is more than these pictures fill in a day, so the disk becomes smaller instead.
  disk.set_capacity(disk.total_bytes().value() - Recording::kReserveBytes - (std::uint64_t{16} << 20));
  stage.run(Duration::seconds(2));
  EXPECT_FALSE(stage.report().recording);
  EXPECT_NE(stage.report().problem.find("near a mark"), std::string::npos) << stage.report().problem;
  EXPECT_EQ(stage.list().at(0).ended, "disk full");
  EXPECT_EQ(stage.list().at(0).deleted_sets, 0U);
}

TEST(LoopDay, WithoutTheLoop_AFullDiskEndsTheTakeAndKeepsAll) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk(1, capacity_for(1'000'000));
  TakeStage stage(disk, clock, {});
  ASSERT_TRUE(stage.start().result);
  stage.run(Duration::seconds(400));
  disk.set_capacity(disk.total_bytes().value() - disk.free_bytes().value() + Recording::kReserveBytes);
  stage.run(Duration::seconds(2));
  EXPECT_FALSE(stage.report().recording);
  EXPECT_NE(stage.report().problem.find("the disk is full; delete takes"), std::string::npos) << stage.report().problem;
  ASSERT_EQ(stage.list().size(), 1U);
  EXPECT_EQ(stage.list()[0].ended, "disk full");
  EXPECT_EQ(account_of(disk, 1).segments.front().first, 0U);
}

}  // namespace
}  // namespace nodal::firmware
