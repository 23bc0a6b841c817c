// When a full disk that records in a loop deletes nothing.
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "firmware/record/loop.h"
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

constexpr std::uint64_t kToStart = 2 * TakeKeeper::kReserveBytes + 150 * kSecond;

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

}  // namespace
}  // namespace nodal::firmware
