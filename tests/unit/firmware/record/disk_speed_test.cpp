// The test of the takes' disk, on simulated disks of known speed.
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "firmware/record/disk_test.h"
#include "hal/sim/clock.h"
#include "hal/sim/disk.h"
#include "tests/support/take_stage.h"

namespace nodal::firmware {
namespace {

/// 153600 bytes a set, 30 a second.
constexpr std::uint64_t kDriverNeeds = 2 * 320 * 240 * 30;

TakeRequest::TestDisk test_of(Duration length) {
  TakeRequest::TestDisk test;
  test.length = length;
  for (int head = 0; head < TakeStage::kStageHeads; ++head)
    test.heads.push_back(HeadShape{PixelFormat::kGrey8, 320, 240});
  return test;
}

class DiskSpeedTest : public testing::Test {
 protected:
  TakeAnswer::DiskTested tested(Duration length = Duration::seconds(10)) {
    const TakeAnswer answer = stage.ask(test_of(length));
    EXPECT_TRUE(answer.result) << answer.result.error().text();
    EXPECT_EQ(files(), 0U) << "what it wrote is removed";
    return answer.result ? std::get<TakeAnswer::DiskTested>(*answer.result) : TakeAnswer::DiskTested();
  }
  std::size_t files() {
    std::size_t found = 0;
    for (const std::string& name : disk.list("").value_or(std::vector<std::string>())) found += name == "disk-test";
    return found;
  }

  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  TakeStage stage{disk, clock, TakeStage::large_pictures()};
};

TEST_F(DiskSpeedTest, AFastDisk_HasItsSpeedAndSustainsEveryMode) {
  disk.set_speed(&clock, 12'000'000);
  const TakeAnswer::DiskTested found = tested();
  EXPECT_NEAR(static_cast<double>(found.speed.bytes_a_second()), 12e6, 0.01 * 12e6);
  EXPECT_GE(found.speed.took, Duration::seconds(10));
  EXPECT_LT(found.speed.took, Duration::seconds(11));
  EXPECT_EQ(found.speed.worst_sync, Duration()) << "writing takes the time on this disk";
  ASSERT_EQ(found.modes.size(), 4U);
  EXPECT_EQ(found.modes[0].mode, "driver");
  EXPECT_EQ(found.modes[0].bytes_a_second, kDriverNeeds);
  EXPECT_EQ(found.modes[1].mode, "raw");
  EXPECT_EQ(found.modes[1].bytes_a_second, kDriverNeeds);
  EXPECT_EQ(found.modes[2].mode, "lossless");
  EXPECT_EQ(found.modes[2].bytes_a_second, kDriverNeeds) << "noise leaves nothing to save";
  EXPECT_EQ(found.modes[3].mode, "jpeg");
  EXPECT_EQ(found.modes[3].bytes_a_second, kDriverNeeds / 4);
  for (const DiskVerdict& mode : found.modes) EXPECT_TRUE(mode.sustained) << mode.why;
  EXPECT_EQ(found.modes[0].why, "needs 4.6 MB/s, and the disk takes 12.0");
}

TEST_F(DiskSpeedTest, HeadsOfDifferentModes_AreJudgedTogetherFirst) {
  TakeStage::Options options = TakeStage::large_pictures();
  options.modes = {TakeMode::kJpeg, TakeMode::kDriver};
  TakeStage mixed(disk, clock, options);
  disk.set_speed(&clock, 12'000'000);
  const TakeAnswer answer = mixed.ask(test_of(Duration::seconds(2)));
  ASSERT_TRUE(answer.result) << answer.result.error().text();
  const auto& modes = std::get<TakeAnswer::DiskTested>(*answer.result).modes;
  ASSERT_EQ(modes.size(), 5U);
  EXPECT_EQ(modes[0].mode, "driver, jpeg");
  EXPECT_EQ(modes[0].bytes_a_second, kDriverNeeds / 2 + kDriverNeeds / 8);
}

TEST_F(DiskSpeedTest, ASlowDisk_SustainsJpegsOnly) {
  disk.set_speed(&clock, 4'000'000);
  const TakeAnswer::DiskTested found = tested();
  ASSERT_EQ(found.modes.size(), 4U);
  EXPECT_FALSE(found.modes[0].sustained) << found.modes[0].why;
  EXPECT_EQ(found.modes[0].why, "needs 4.6 MB/s, and the disk takes 4.0");
  EXPECT_TRUE(found.modes[3].sustained) << found.modes[3].why;
  disk.set_speed(&clock, 5'000'000);
  const TakeAnswer::DiskTested barely = tested();
  EXPECT_FALSE(barely.modes.at(0).sustained);
  EXPECT_NE(barely.modes.at(0).why.find("less than a quarter more"), std::string::npos) << barely.modes[0].why;
}

TEST(JudgeDisk, ASyncThatTakesLongerThanTheBufferHolds_IsNamed) {
  const DiskSpeed stalls{1'000'000'000, Duration::seconds(10), Duration::seconds(4)};
  const DiskVerdict verdict = judge_disk(stalls, "driver", 10'000'000, 16U << 20);
  EXPECT_FALSE(verdict.sustained);
  EXPECT_EQ(verdict.why, "a sync took 4.0 s, in which 40 MB come in; [takes] buffer_mb holds 17 MB");
  EXPECT_TRUE(judge_disk(stalls, "driver", 4'000'000, 16U << 20).sustained) << "16 MB come in";
}

TEST_F(DiskSpeedTest, AStall_IsTheLongestSyncOrSlowsTheDisk) {
  disk.be_slow(&clock, Duration::milliseconds(300));
  const TakeAnswer::DiskTested found = tested(Duration::seconds(5));
  EXPECT_EQ(found.speed.worst_sync, Duration::milliseconds(300));
  // Two pieces and a sync take 0.9 s.
  EXPECT_NEAR(static_cast<double>(found.speed.bytes_a_second()), 2.0 * DiskTest::kPiece / 0.9, 1e6);
}

TEST_F(DiskSpeedTest, WhileATakeIsRecorded_IsRefusedAndATakeEndsIt) {
  disk.set_speed(&clock, 50'000'000);
  ASSERT_TRUE(stage.start().result);
  const TakeAnswer refused = stage.ask(test_of(Duration::seconds(2)));
  ASSERT_FALSE(refused.result);
  EXPECT_NE(refused.result.error().message.find("a take is being recorded"), std::string::npos);
  ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);

  stage.request(test_of(Duration::seconds(10)));
  stage.run(Duration::seconds(1));
  EXPECT_EQ(files(), 1U);
  ASSERT_TRUE(stage.report().test_percent);
  EXPECT_GE(*stage.report().test_percent, 5U);
  EXPECT_LE(*stage.report().test_percent, 30U);
  const TakeAnswer ended = stage.start();  // the answer to the test comes first
  ASSERT_FALSE(ended.result);
  EXPECT_NE(ended.result.error().message.find("a take began"), std::string::npos);
  EXPECT_EQ(files(), 0U);
  stage.run(Duration::seconds(1));
  EXPECT_TRUE(stage.report().recording);
  EXPECT_FALSE(stage.report().test_percent);
}

TEST_F(DiskSpeedTest, DisksThatCannotBeTested_SayWhy) {
  TakeRequest::TestDisk nothing_known = test_of(Duration::seconds(1));
  nothing_known.heads = {std::nullopt, std::nullopt};
  EXPECT_EQ(stage.ask(nothing_known).result.error().code, Errc::kNotReady);
  disk.set_capacity(DiskTest::kMinRoom - 1);
  EXPECT_EQ(stage.ask(test_of(Duration::seconds(1))).result.error().code, Errc::kDiskFull);
  disk.set_capacity(std::uint64_t{1} << 40);
  disk.set_speed(&clock, 50'000'000);
  stage.request(test_of(Duration::seconds(5)));
  stage.run(Duration::seconds(1));
  disk.unplug();
  const TakeAnswer gone = stage.next_answer();
  ASSERT_FALSE(gone.result);
  EXPECT_EQ(gone.result.error().code, Errc::kDeviceGone);
}

TEST_F(DiskSpeedTest, NodaldIsKilledInATest_TheNextRemovesWhatItWrote) {
  disk.set_speed(&clock, 50'000'000);
  stage.request(test_of(Duration::seconds(5)));
  stage.run(Duration::seconds(1));
  const auto left = disk.after_kill();
  ASSERT_TRUE(left->size("disk-test"));
  hal::sim::SimClock later;
  TakeStage next(*left, later, TakeStage::large_pictures());
  EXPECT_FALSE(left->size("disk-test"));
}

}  // namespace
}  // namespace nodal::firmware
