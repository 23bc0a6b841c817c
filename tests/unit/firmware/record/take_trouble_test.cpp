// Disks that are full, slow, stalled, read-only, removed and broken while a take is recorded: one message each, and
// what was on the disk for certain stays.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "firmware/record/recording.h"
#include "hal/sim/clock.h"
#include "hal/sim/disk.h"
#include "tests/support/take_account.h"
#include "tests/support/take_stage.h"

namespace nodal::firmware {
namespace {

constexpr std::uint64_t kStageNeeds = 2 * Recording::kReserveBytes;

/// The takes that nodald finds on the disk when it starts again, after it has finished what was not ended.
std::vector<TakeEntry> takes_after_restart(hal::sim::SimDisk& disk) {
  hal::sim::SimClock clock;
  TakeStage stage(disk, clock, {});
  stage.run(Duration::seconds(1));
  EXPECT_TRUE(stage.report().ready);
  return stage.list();
}

TEST(TakeTrouble, TheDiskIsFullBetweenTwoSyncs_TheTakeEndsWithWhatIsWhole) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage(disk, clock, {});
  ASSERT_TRUE(stage.start().result);
  stage.run(Duration::seconds(70));
  const std::uint64_t before = stage.report().sets;
  disk.set_capacity(disk.total_bytes().value() - disk.free_bytes().value() + 1000);
  stage.run(Duration::seconds(1));
  EXPECT_FALSE(stage.report().recording);
  ASSERT_EQ(stage.problems().size(), 1U);
  EXPECT_NE(stage.problems()[0].find("the disk is full"), std::string::npos) << stage.problems()[0];
  const auto again = stage.start();
  ASSERT_FALSE(again.result);
  EXPECT_EQ(again.result.error().code, Errc::kDiskFull);
  EXPECT_NE(again.result.error().message.find("0 MB free, and a take needs at least 134 MB"), std::string::npos)
      << again.result.error().message;
  disk.set_capacity(std::uint64_t{1} << 40);
  EXPECT_TRUE(stage.start().result) << "there is room again";
  ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  for (const TakeEntry& entry : takes_after_restart(disk)) EXPECT_EQ(entry.state, TakeState::kComplete) << entry.number;
  const TakeAccount account = account_of(disk, 1);
  EXPECT_GE(account.sets + 3, before);
  EXPECT_EQ(account.segments.size(), 2U);
}

TEST(TakeTrouble, LessThanAMinuteOfRoom_StartsNoTake) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage(disk, clock, TakeStage::large_pictures());
  constexpr std::uint64_t kSet = 2 * 320 * 240;
  disk.set_capacity(kStageNeeds + 60 * 30 * kSet - 1'000'000);
  const auto refused = stage.start();
  ASSERT_FALSE(refused.result);
  EXPECT_EQ(refused.result.error().code, Errc::kDiskFull);
  EXPECT_TRUE(stage.list().empty());
  disk.set_capacity(kStageNeeds + 60 * 30 * kSet + 1'000'000);
  EXPECT_TRUE(stage.start().result);
}

TEST(TakeTrouble, TheReserveIsReached_TheTakeEndsAndIsFinished) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk(1, kStageNeeds + 300'000'000);
  TakeStage stage(disk, clock, TakeStage::large_pictures());
  ASSERT_TRUE(stage.start().result);
  stage.run(Duration::seconds(120));
  EXPECT_FALSE(stage.report().recording);
  EXPECT_GE(disk.free_bytes().value(), Recording::kReserveBytes - 1'000'000);
  EXPECT_LE(disk.free_bytes().value(), Recording::kReserveBytes + 20'000'000);
  ASSERT_EQ(stage.problems().size(), 1U);
  EXPECT_NE(stage.problems()[0].find("take 1 ended: the disk is full; delete takes"), std::string::npos);
  ASSERT_EQ(stage.list().size(), 1U);
  EXPECT_EQ(stage.list()[0].state, TakeState::kComplete);
  EXPECT_EQ(stage.list()[0].ended, "disk full");
  EXPECT_EQ(stage.list()[0].lost_sets, 0U);
  EXPECT_EQ(account_of(disk, 1).sets, stage.list()[0].sets);
}

TEST(TakeTrouble, NoSetComesForFiveSeconds_TheListSaysHowManyWereNotCaptured) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage(disk, clock, {});
  ASSERT_TRUE(stage.start().result);
  stage.run(Duration::seconds(4));
  stage.pause(Duration::seconds(5));
  stage.run(Duration::seconds(9));
  ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  const TakeEntry entry = stage.list().at(0);
  EXPECT_EQ(entry.lost_sets, 0U);
  EXPECT_EQ(entry.gaps.capture, 25U);
  EXPECT_EQ(entry.gaps.count, 1U);
  EXPECT_EQ(entry.gaps.longest, Duration::seconds(5));
}

TEST(TakeTrouble, ASlowDisk_LosesWholeSetsWhichAreCountedAndGoesOn) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage(disk, clock, TakeStage::large_pictures());
  ASSERT_TRUE(stage.start().result);
  stage.run(Duration::seconds(5));
  EXPECT_EQ(stage.report().lost_sets, 0U);
  disk.set_speed(&clock, 2'000'000);  // the take needs 4.6 MB/s
  stage.run(Duration::seconds(30));
  const std::uint64_t lost = stage.report().lost_sets;
  EXPECT_GT(stage.report().buffer_percent, 50U);
  disk.set_speed(&clock, 100'000'000);
  stage.run(Duration::seconds(20));
  const std::uint64_t all_lost = stage.report().lost_sets;
  EXPECT_LT(stage.report().buffer_percent, 10U);
  stage.run(Duration::seconds(5));
  EXPECT_EQ(stage.report().lost_sets, all_lost) << "the disk keeps up again";
  // Of 30 s, the disk took 2/4.6 and the ring 16 MB.
  EXPECT_GT(lost, 300U);
  EXPECT_LT(lost, 600U);
  ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  EXPECT_TRUE(stage.problems().empty());
  const TakeAccount account = account_of(disk, 1);
  EXPECT_EQ(stage.list()[0].lost_sets, all_lost);
  EXPECT_EQ(account.missed, all_lost);
  EXPECT_EQ(account.sets, stage.list()[0].sets);
}

/// Rows always wait then, and must not keep a person from ending the take.
TEST(TakeTrouble, ADiskThatIsAlwaysBusy_RequestsAreAnsweredAndTheTakeEndsOnceTheBufferIsWritten) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage(disk, clock, TakeStage::large_pictures());
  ASSERT_TRUE(stage.start().result);
  disk.set_speed(&clock, 2'000'000);  // the take needs 4.6 MB/s
  stage.run(Duration::seconds(30));
  const auto took = [&](TakeCommand what) {
    const Instant asked = clock.now();
    EXPECT_TRUE(stage.ask(std::move(what)).result);
    return clock.now() - asked;
  };
  EXPECT_LT(took(TakeRequest::Mark{"here"}), Duration::seconds(5));
  EXPECT_LT(took(TakeRequest::List{}), Duration::seconds(5));
  EXPECT_LT(took(TakeRequest::Stop{}), Duration::seconds(15)) << "16 MB wait for the disk";
  EXPECT_EQ(stage.list().at(0).state, TakeState::kComplete);
}

TEST(TakeTrouble, AStallOfFiveSeconds_LosesNothingThatTheBufferHolds) {
  for (const bool large : {false, true}) {
    SCOPED_TRACE(large ? "the buffer holds three and a half seconds" : "the buffer holds all");
    hal::sim::SimClock clock;
    hal::sim::SimDisk disk;
    TakeStage stage(disk, clock, large ? TakeStage::large_pictures() : TakeStage::Options());
    ASSERT_TRUE(stage.start().result);
    for (int k = 0; k < 4; ++k) {
      stage.run(Duration::milliseconds(9000 + 70 * k));  // another operation each time
      disk.stall(&clock, Duration::seconds(5));
    }
    stage.run(Duration::seconds(10));
    const std::uint64_t lost = stage.report().lost_sets;
    ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);
    EXPECT_TRUE(stage.problems().empty());
    const TakeAccount account = account_of(disk, 1);
    EXPECT_EQ(account.missed, lost);
    EXPECT_EQ(account.cut, 0U);
    if (large) {
      // Each time 150 sets come, and 109 fit the buffer.
      EXPECT_GE(lost, 4U * 41);
      EXPECT_LT(lost, 4U * 60);
    } else {
      EXPECT_EQ(lost, 0U);
    }
  }
}

TEST(TakeTrouble, ASyncFails_SaysHowManySetsAreLostAndRecordsOn) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage(disk, clock, {});
  ASSERT_TRUE(stage.start().result);
  stage.run(Duration::seconds(10));
  disk.fail_syncs(1);
  stage.run(Duration::seconds(10));
  ASSERT_EQ(stage.problems().size(), 1U);
  const std::uint64_t lost = stage.report().lost_sets;
  EXPECT_GE(lost, 1U);
  EXPECT_LE(lost, 4U) << "of half a second";
  EXPECT_NE(stage.problems()[0].find("take 1: " + std::to_string(lost) +
                                     " sets were lost by an error of the disk, and a new segment begins"),
            std::string::npos)
      << stage.problems()[0];
  ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  const TakeAccount account = account_of(disk, 1);
  EXPECT_EQ(account.segments.size(), 2U);
  EXPECT_EQ(account.cut, lost);
  EXPECT_EQ(stage.list()[0].lost_sets, lost);
}

/// A fault at one of 40 moments while a take is recorded that has a finished segment; then it ends, and nodald starts
/// again. `begin` gets the number of the moment. Returns how often the take ended by the fault.
int fail_at_any_moment(const std::function<void(hal::sim::SimDisk&, std::uint64_t moment)>& begin,
                       const std::function<void(hal::sim::SimDisk&)>& heal, const std::string& says) {
  int ended = 0;
  for (std::uint64_t moment = 0; moment < 40; ++moment) {
    SCOPED_TRACE("moment " + std::to_string(moment));
    hal::sim::SimClock clock;
    hal::sim::SimDisk disk;
    std::uint64_t before = 0;
    {
      TakeStage stage(disk, clock, {});
      EXPECT_TRUE(stage.start().result);
      stage.run(Duration::seconds(61) + Duration::milliseconds(40) * static_cast<std::int64_t>(moment));
      before = stage.report().sets;
      begin(disk, moment);
      stage.run(Duration::seconds(5));
      EXPECT_EQ(stage.problems().size(), 1U);
      for (const std::string& problem : stage.problems()) EXPECT_NE(problem.find(says), std::string::npos) << problem;
      ended += stage.report().recording ? 0 : 1;
      if (stage.report().recording) {
        EXPECT_TRUE(stage.ask(TakeRequest::Stop{}).result);
      }
    }
    heal(disk);
    const std::vector<TakeEntry> takes = takes_after_restart(disk);
    EXPECT_EQ(takes.size(), 1U);
    for (const TakeEntry& take : takes) EXPECT_EQ(take.state, TakeState::kComplete) << take.problem;
    const TakeAccount account = account_of(disk, 1);
    EXPECT_EQ(account.sets, takes.at(0).sets);
    EXPECT_GE(account.sets + 5, before) << "but for a second";
    // Rows of two sets; a segment ends with the first that is 60 s long.
    EXPECT_EQ(account.segments.at(0), std::make_pair(std::uint64_t{0}, std::uint64_t{302}));
  }
  return ended;
}

TEST(TakeTrouble, AnOperationFails_TheTakeEndsOrBeginsASegmentAndSaysSoOnce) {
  const int ended = fail_at_any_moment([](auto& disk, std::uint64_t k) { disk.fail_at(disk.operations() + k); },
                                       [](auto&) {}, "reports an error");
  EXPECT_GT(ended, 20) << "by a write";
  EXPECT_LT(ended, 40) << "not by a sync";
}

TEST(TakeTrouble, TheDiskBecomesReadOnly_TheTakeEndsAndIsFinishedAtTheNextStart) {
  const int ended = fail_at_any_moment([](auto& disk, std::uint64_t) { disk.be_read_only(); },
                                       [](auto& disk) { disk.be_read_only(false); },
                                       "take 1 ended, and is finished when nodald starts again: file '000001/");
  EXPECT_EQ(ended, 40);
}

TEST(TakeTrouble, TheDiskIsRemoved_TheTakeEndsAndIsFinishedAtTheNextStart) {
  const int ended = fail_at_any_moment([](auto& disk, std::uint64_t) { disk.unplug(); },
                                       [](auto& disk) { disk.unplug(false); }, "the disk is gone");
  EXPECT_EQ(ended, 40);
}

TEST(TakeTrouble, ReadsFailWhenNodaldStarts_TheTakeIsDamagedUntilTheyWork) {
  hal::sim::SimDisk disk;
  {
    hal::sim::SimClock clock;
    TakeStage stage(disk, clock, {});
    for (int take = 0; take < 2; ++take) {
      ASSERT_TRUE(stage.start().result);
      stage.run(Duration::seconds(10));
      if (take == 0) {
        ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);
      }
    }
  }
  for (int failing = 1; failing < 12; ++failing) {
    SCOPED_TRACE(failing);
    const auto copy = disk.after_kill();
    copy->fail_reads(failing);
    std::size_t damaged = 0;
    for (const TakeEntry& entry : takes_after_restart(*copy)) {
      if (entry.state == TakeState::kComplete) continue;
      ++damaged;
      EXPECT_EQ(entry.state, TakeState::kDamaged);
      EXPECT_NE(entry.problem.find("reading it failed"), std::string::npos) << entry.problem;
    }
    EXPECT_GE(damaged, failing == 1 ? 0U : 1U);
    copy->fail_reads(0);
    for (const TakeEntry& entry : takes_after_restart(*copy)) {
      EXPECT_EQ(entry.state, TakeState::kComplete) << entry.problem;
      EXPECT_EQ(account_of(*copy, entry.number).sets, entry.sets);
    }
  }
}

/// A take of ten seconds that nodald did not end.
std::unique_ptr<hal::sim::SimDisk> killed_take() {
  hal::sim::SimDisk disk;
  hal::sim::SimClock clock;
  TakeStage stage(disk, clock, {});
  EXPECT_TRUE(stage.start().result);
  stage.run(Duration::seconds(10));
  return disk.after_kill();
}

TEST(TakeTrouble, TheLastBytesOfAFileCannotBeRead_TheTakeIsCutBeforeThem) {
  const std::uint64_t all = takes_after_restart(*killed_take()).at(0).sets;
  for (const std::string name : {"000001/cam1-0000.mkv", "000001/evidence-0000"}) {
    SCOPED_TRACE(name);
    const auto disk = killed_take();
    // 512 bytes of a picture: less than half a second, which is 3 sets. Of the evidence, a few records.
    disk->spoil(name, disk->size(name).value() - 100);
    const std::vector<TakeEntry> takes = takes_after_restart(*disk);
    ASSERT_EQ(takes.size(), 1U);
    EXPECT_EQ(takes[0].state, TakeState::kComplete) << takes[0].problem;
    EXPECT_LT(takes[0].sets, all);
    EXPECT_GE(takes[0].sets + 5, all) << "at most a second";
    EXPECT_EQ(account_of(*disk, 1).sets, takes[0].sets);
  }
}

TEST(TakeTrouble, AFileOfASegmentIsGone_TheOtherSegmentsAreTheTakeAndItSaysSo) {
  hal::sim::SimDisk disk;
  {
    hal::sim::SimClock clock;
    TakeStage stage(disk, clock, {});
    ASSERT_TRUE(stage.start().result);
    stage.run(Duration::seconds(70));
  }
  ASSERT_TRUE(disk.remove("000001/cam0-0001.mkv"));
  const std::vector<TakeEntry> takes = takes_after_restart(disk);
  ASSERT_EQ(takes.size(), 1U);
  EXPECT_EQ(takes[0].state, TakeState::kComplete) << takes[0].problem;
  EXPECT_EQ(takes[0].ended, "recovered, without segment 1");
  EXPECT_EQ(takes[0].sets, account_of(disk, 1, 1).sets);
  EXPECT_GE(takes[0].sets, 300U) << "a minute";
  EXPECT_TRUE(disk.size("000001/cam1-0001.mkv")) << "what is left of it stays";
}

TEST(TakeTrouble, WhatWasDurableCannotBeRead_TheTakeIsDamagedAndNothingIsCut) {
  for (const std::string name : {"000001/cam1-0000.mkv", "000001/evidence-0000"}) {
    SCOPED_TRACE(name);
    hal::sim::SimDisk disk;
    {
      hal::sim::SimClock clock;
      TakeStage::Options large;
      large.rate = {100, 1};  // 0.6 MB of evidence
      TakeStage stage(disk, clock, large);
      ASSERT_TRUE(stage.start().result);
      stage.run(Duration::seconds(50));
    }
    disk.spoil(name, disk.size(name).value() / 2);
    const std::uint64_t length = disk.size(name).value();
    const std::vector<TakeEntry> takes = takes_after_restart(disk);
    ASSERT_EQ(takes.size(), 1U);
    EXPECT_EQ(takes[0].state, TakeState::kDamaged);
    EXPECT_NE(takes[0].problem.find("reading it failed"), std::string::npos) << takes[0].problem;
    EXPECT_EQ(disk.size(name).value(), length);
  }
}

/// exFAT moves a file in two steps, so both of its names may be gone.
TEST(TakeTrouble, ThePowerFailsWhenATakeBegins_ItsFolderGoesAndTheOthersStay) {
  for (const std::string left : {"", "calibration.json", "rig.toml.tmp", "take.json.tmp", "take.json"}) {
    SCOPED_TRACE("left: " + left);
    const auto disk = killed_take();
    ASSERT_TRUE(disk->make_folder("000002"));
    if (!left.empty()) {
      const auto file = disk->create("000002/" + left);
      ASSERT_TRUE(file);
      ASSERT_TRUE(disk->write(*file, std::vector<std::uint8_t>{'{', '"', 'v'}));
    }
    const std::vector<TakeEntry> takes = takes_after_restart(*disk);
    ASSERT_EQ(takes.size(), 1U);
    EXPECT_EQ(takes[0].number, 1U);
    EXPECT_EQ(takes[0].state, TakeState::kComplete) << takes[0].problem;
    EXPECT_FALSE(disk->list("000002"));
  }
}

TEST(TakeTrouble, AFolderWithoutTakeJsonHasAPicture_ItStaysAndIsDamaged) {
  const auto disk = killed_take();
  ASSERT_TRUE(disk->remove("000001/take.json"));
  const std::vector<TakeEntry> takes = takes_after_restart(*disk);
  ASSERT_EQ(takes.size(), 1U);
  EXPECT_EQ(takes[0].state, TakeState::kDamaged);
  EXPECT_TRUE(disk->size("000001/cam0-0000.mkv"));
}

}  // namespace
}  // namespace nodal::firmware
