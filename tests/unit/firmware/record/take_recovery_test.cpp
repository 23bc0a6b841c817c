// Takes that cannot be recovered: what a rig does with them, and that it films all the same.
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "firmware/record/take_recovery.h"
#include "hal/sim/confined.h"
#include "hal/sim/disk.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "tests/support/take_stage.h"

namespace nodal::firmware {
namespace {

/// A disk with takes that nodald did not end.
std::unique_ptr<hal::sim::SimDisk> killed_takes(int count) {
  auto disk = std::make_unique<hal::sim::SimDisk>();
  for (int k = 0; k < count; ++k) {
    hal::sim::SimClock clock;
    TakeStage::Options options;
    // Earlier ones stay as they are.
    hal::sim::SimConfined never([](const hal::ConfinedJob&, const hal::ConfinedProgress&) {
      return Result<std::vector<std::uint8_t>>(std::vector<std::uint8_t>());
    });
    never.hold();
    options.confined = &never;
    TakeStage stage(*disk, clock, options);
    EXPECT_TRUE(stage.start().result);
    stage.run(Duration::seconds(3));
  }
  for (int k = 1; k <= count; ++k) (void)disk->remove("00000" + std::to_string(k) + "/recovering");
  return disk;
}

hal::ConfinedWork recovers(hal::DiskPort& disk) {
  return [&disk](const hal::ConfinedJob& job, const hal::ConfinedProgress& progress) {
    return recovery_work(disk, job.what, progress);
  };
}

/// The takes after a start of nodald with this port.
std::vector<TakeEntry> takes_with(hal::DiskPort& disk, hal::ConfinedPort& port, std::string* problem = nullptr) {
  hal::sim::SimClock clock;
  TakeStage::Options options;
  options.confined = &port;
  TakeStage stage(disk, clock, options);
  stage.run(Duration::seconds(10));
  if (problem) *problem = stage.report().problem;
  const std::vector<TakeEntry> takes = stage.list();
  stage.close();
  return takes;
}

TEST(TakeRecovery, BesideTheStage_FinishesEveryTakeAndLeavesNoTrace) {
  const auto disk = killed_takes(3);
  hal::sim::SimConfined port(recovers(*disk));
  const std::vector<TakeEntry> takes = takes_with(*disk, port);
  ASSERT_EQ(takes.size(), 3u);
  for (const TakeEntry& take : takes) {
    EXPECT_EQ(take.state, TakeState::kComplete) << take.problem;
    EXPECT_GT(take.sets, 5u);
    EXPECT_FALSE(disk->size(take::take_folder(take.number) + "/" + take::kRecoveringFile));
  }
  EXPECT_EQ(port.begun(), 3);
}

TEST(TakeRecovery, CrashesTwice_TheTakeIsSetAsideNamedAndNotTriedAgain) {
  const auto disk = killed_takes(2);
  for (int start = 1; start <= 3; ++start) {
    SCOPED_TRACE("start " + std::to_string(start));
    // Take 2 ends whatever recovers it.
    hal::sim::SimConfined port([&](const hal::ConfinedJob& job, const hal::ConfinedProgress& progress) {
      if (job.what == "000002")
        return Result<std::vector<std::uint8_t>>(fail(Errc::kOverload, "needs more than 384 MiB"));
      return recovery_work(*disk, job.what, progress);
    });
    std::string problem;
    const std::vector<TakeEntry> takes = takes_with(*disk, port, &problem);
    ASSERT_EQ(takes.size(), 2u);
    EXPECT_EQ(takes[0].state, TakeState::kComplete) << takes[0].problem;
    EXPECT_EQ(takes[1].state, start == 1 ? TakeState::kDamaged : TakeState::kSetAside);
    EXPECT_NE(takes[1].problem.find("384 MiB"), std::string::npos) << takes[1].problem;
    EXPECT_EQ(problem.find("take 2 is set aside") != std::string::npos, start > 1) << problem;
    EXPECT_EQ(port.begun(), start == 1 ? 2 : start == 2 ? 1 : 0);
  }
  EXPECT_TRUE(disk->size("000002/cam0-0000.mkv")) << "nothing of it is deleted";
  EXPECT_TRUE(disk->size("000002/evidence-0000"));
}

TEST(TakeRecovery, PowerFailsInTwoAttempts_TheThirdStartSetsTheTakeAside) {
  auto disk = killed_takes(1);
  for (int start = 1; start <= 3; ++start) {
    SCOPED_TRACE("start " + std::to_string(start));
    hal::sim::SimConfined port(recovers(*disk));
    port.hold();
    hal::sim::SimClock clock;
    TakeStage::Options options;
    options.confined = &port;
    {
      TakeStage stage(*disk, clock, options);
      stage.run(Duration::seconds(1));
      EXPECT_EQ(stage.list()[0].state, start == 3 ? TakeState::kSetAside : TakeState::kUnfinished);
    }  // not closed: the power fails
    disk = disk->after_power_loss(static_cast<std::uint64_t>(start));
  }
}

TEST(TakeRecovery, NodaldEndsMeanwhile_TheAttemptDoesNotCount) {
  const auto disk = killed_takes(1);
  for (int start = 0; start < 4; ++start) {
    hal::sim::SimConfined port(recovers(*disk));
    port.hold();
    (void)takes_with(*disk, port);
    EXPECT_EQ(port.begun(), 1);
  }
  hal::sim::SimConfined port(recovers(*disk));
  EXPECT_EQ(takes_with(*disk, port)[0].state, TakeState::kComplete);
}

TEST(TakeRecovery, DiskFails_TheAttemptDoesNotCount) {
  const auto disk = killed_takes(1);
  for (int start = 0; start < 4; ++start) {
    hal::sim::SimConfined port([](const hal::ConfinedJob&, const hal::ConfinedProgress&) {
      return Result<std::vector<std::uint8_t>>(fail(Errc::kIo, "file 'x': reading it failed"));
    });
    EXPECT_EQ(takes_with(*disk, port)[0].state, TakeState::kDamaged);
  }
  hal::sim::SimConfined port(recovers(*disk));
  EXPECT_EQ(takes_with(*disk, port)[0].state, TakeState::kComplete);
}

TEST(TakeRecovery, WhileItDoesNotEnd_ATakeIsRecordedAndOthersAreListed) {
  const auto disk = killed_takes(1);
  hal::sim::SimConfined port(recovers(*disk));
  port.hold();
  hal::sim::SimClock clock;
  TakeStage::Options options;
  options.confined = &port;
  TakeStage stage(*disk, clock, options);
  stage.run(Duration::seconds(1));
  EXPECT_TRUE(stage.report().ready) << "a take may begin by itself";
  const TakeAnswer started = stage.start();
  ASSERT_TRUE(started.result) << started.result.error().text();
  stage.run(Duration::seconds(5));
  const TakeAnswer deleted = stage.ask(TakeRequest::Delete{1});
  ASSERT_FALSE(deleted.result) << "it is being recovered";
  EXPECT_EQ(deleted.result.error().code, Errc::kBusy);
  port.hold(false);
  stage.run(Duration::seconds(5));
  ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  const std::vector<TakeEntry> takes = stage.list();
  ASSERT_EQ(takes.size(), 2u);
  EXPECT_EQ(takes[0].state, TakeState::kComplete) << takes[0].problem;
  EXPECT_EQ(takes[1].state, TakeState::kComplete) << takes[1].problem;
  stage.close();
}

}  // namespace
}  // namespace nodal::firmware
