// When a full disk that records in a loop deletes nothing.
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "firmware/record/loop.h"
#include "firmware/record/recording.h"
#include "hal/sim/card_slot.h"
#include "hal/sim/disk.h"
#include "tests/support/take_account.h"
#include "tests/support/take_stage.h"

namespace nodal::firmware {
namespace {

/// Of large_pictures().
constexpr std::uint64_t kSecond = 2 * 320 * 240 * 30;

TakeStage::Options in_a_loop() {
  TakeStage::Options options = TakeStage::large_pictures();  // 4.6 MB/s
  options.takes.loop = true;
  return options;
}

/// A disk with the finished takes 1, of 130 s, and 2, of 190 s, of which marks keep all but the first segment.
struct World {
  World() {
    record(Duration::seconds(130));
    EXPECT_TRUE(stage.start().result);
    stage.run(Duration::seconds(170));
    EXPECT_TRUE(stage.ask(TakeRequest::Mark{"keep"}).result);
    stage.run(Duration::seconds(20));
    EXPECT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  }
  void record(Duration length) {
    EXPECT_TRUE(stage.start().result);
    stage.run(length);
    EXPECT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  }
  void leave_free(std::uint64_t bytes) {
    disk.set_capacity(disk.total_bytes().value() - disk.free_bytes().value() + bytes);
  }
  std::vector<std::uint64_t> sets() {
    std::vector<std::uint64_t> sets;
    for (const TakeEntry& take : stage.list()) sets.push_back(take.sets);
    return sets;
  }

  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage{disk, clock, in_a_loop()};
};

constexpr std::uint64_t kToStart = 2 * Recording::kReserveBytes + 150 * kSecond;

TEST(LoopPlan, WhatMayBeDeletedDoesNotMakeRoomForATake_NothingIsDeleted) {
  World world;
  ASSERT_TRUE(world.stage.ask(TakeRequest::Protect{1, true}).result);
  const std::vector<std::uint64_t> before = world.sets();
  world.leave_free(kToStart - 100 * kSecond);
  const TakeAnswer refused = world.stage.start();
  ASSERT_FALSE(refused.result) << "a minute may go";
  EXPECT_EQ(refused.result.error().code, Errc::kDiskFull);
  EXPECT_EQ(world.sets(), before);
  EXPECT_EQ(world.stage.report().deleted_segments, 0U);
  world.leave_free(kToStart - 30 * kSecond);
  EXPECT_TRUE(world.stage.start().result);
  EXPECT_EQ(world.stage.report().deleted_segments, 1U);
}

TEST(LoopPlan, ATakeIsBeingCopied_ItStaysAndOthersGo) {
  World world;
  world.stage.in_use().set(3, 1);  // as control notes it
  const std::vector<std::uint64_t> before = world.sets();
  world.leave_free(kToStart - 100 * kSecond);
  ASSERT_FALSE(world.stage.start().result) << "take 2 alone does not make room";
  EXPECT_EQ(world.sets(), before);
  world.leave_free(kToStart - 30 * kSecond);
  ASSERT_TRUE(world.stage.start().result);
  EXPECT_EQ(world.sets().at(0), before.at(0));
  EXPECT_LT(world.sets().at(1), before.at(1));
  world.stage.run(Duration::seconds(400));
  EXPECT_TRUE(world.stage.report().recording) << "its own oldest segments go: " << world.stage.report().problem;
  EXPECT_EQ(world.sets().at(0), before.at(0));
  world.stage.in_use().set(3, 0);
  world.stage.run(Duration::seconds(100));
  EXPECT_TRUE(world.sets().size() < 3 || world.sets().at(0) < before.at(0)) << "the copy is done";
}

TEST(LoopPlan, ARecordingMustEndAllTheSame_NothingIsDeletedForIt) {
  World world;
  world.record(Duration::seconds(10));
  for (const std::uint64_t take : {1U, 2U}) ASSERT_TRUE(world.stage.ask(TakeRequest::Protect{take, true}).result);
  ASSERT_TRUE(world.stage.start().result);
  world.stage.run(Duration::seconds(10));
  const std::vector<std::uint64_t> before = world.sets();
  world.leave_free(0);  // another program fills the disk; take 3 has less than finishing the files needs
  world.stage.run(Duration::seconds(2));
  EXPECT_FALSE(world.stage.report().recording);
  const std::vector<std::uint64_t> after = world.sets();
  ASSERT_GE(after.size(), 3U);
  EXPECT_EQ(after.at(2), before.at(2));
  EXPECT_EQ(world.stage.report().deleted_segments, 0U);
}

TEST(LoopPlan, OnlyTheRunningTakeCanMakeRoom_ItsOldestSegmentGoesAndItGoesOn) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage(disk, clock, in_a_loop());
  ASSERT_TRUE(stage.start().result);
  stage.run(Duration::seconds(70));
  // Less than what the rows on the way and the end need: another program has filled the disk.
  disk.set_capacity(disk.total_bytes().value() - disk.free_bytes().value() + Recording::kReserveBytes / 2);
  stage.run(Duration::seconds(2));
  EXPECT_TRUE(stage.report().recording) << stage.report().problem;
  EXPECT_EQ(stage.report().deleted_segments, 1U);
}

TEST(LoopPlan, ACardComesWithATakeToFinishAndARecordingNeedsItsRoom_ItIsFinishedTrimmedAndTheDiskLetGo) {
  TakeStage::Options options;
  options.takes.loop = true;
  auto card = std::make_shared<hal::sim::SimDisk>();
  {
    hal::sim::SimClock clock;
    TakeStage killed(*card, clock, options);
    ASSERT_TRUE(killed.start().result);
    killed.run(Duration::seconds(130));
  }
  card = card->after_kill();
  constexpr std::uint64_t kSmallSecond = 2 * 32 * 16 * 5;
  card->set_capacity(card->total_bytes().value() - card->free_bytes().value() + 2 * Recording::kReserveBytes +
                     120 * kSmallSecond);
  hal::sim::SimClock clock;
  hal::sim::SimCardSlot slot;
  slot.insert(std::make_shared<hal::sim::SimDisk>(1));
  const auto port = slot.port();
  TakeStage stage(*port, clock, options);
  slot.insert(card);
  clock.advance(TakeKeeper::kLookEvery);  // it is noticed in the step that also begins the take
  const TakeAnswer started = stage.start();
  ASSERT_TRUE(started.result) << started.result.error().text();
  EXPECT_EQ(stage.report().deleted_segments, 1U);
  const TakeEntry finished = stage.list().at(0);
  EXPECT_EQ(finished.ended, "recovered");
  EXPECT_GT(finished.deleted_sets, 0U);
  ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  stage.run(Duration::seconds(2));
  EXPECT_FALSE(card->claimed()) << "nothing of it is held while nothing is recorded";
}

}  // namespace
}  // namespace nodal::firmware
