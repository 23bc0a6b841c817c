// Takes that are deleted while the power fails, or on a full disk.
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "hal/sim/disk.h"
#include "tests/support/take_stage.h"

namespace nodal::firmware {
namespace {

constexpr std::size_t kTakes = 2;

/// With finished takes 1 and 2.
void record_takes(hal::sim::SimDisk& disk) {
  hal::sim::SimClock clock;
  TakeStage stage(disk, clock, {});
  for (std::size_t k = 0; k < kTakes; ++k) {
    ASSERT_TRUE(stage.start().result);
    stage.run(Duration::seconds(1));
    ASSERT_TRUE(stage.ask(TakeRequest::Stop{}).result);
  }
  ASSERT_TRUE(disk.sync_all());
}

std::vector<TakeEntry> takes_of(hal::sim::SimDisk& disk) {
  hal::sim::SimClock clock;
  TakeStage stage(disk, clock, {});
  stage.run(Duration::seconds(1));
  return stage.list();
}

TEST(TakeDelete, ThePowerFailsAtAnyOperation_TheTakeIsWholeOrGoneAndTheOtherStays) {
  std::size_t whole = 0, gone = 0;
  std::uint64_t begin = 0, end = ~std::uint64_t{0};
  for (std::uint64_t k = 0; begin + k <= end; ++k) {
    for (std::uint64_t seed = 0; seed < 16; ++seed) {
      SCOPED_TRACE("operation " + std::to_string(k) + " seed " + std::to_string(seed));
      hal::sim::SimDisk disk(seed);
      record_takes(disk);
      hal::sim::SimClock clock;
      TakeStage stage(disk, clock, {});
      begin = disk.operations();
      disk.die_at(begin + k);
      const bool deleted = stage.ask(TakeRequest::Delete{1}).result.has_value();
      if (!disk.dead()) end = disk.operations();
      const auto left = disk.after_power_loss(seed + 1);
      const std::vector<TakeEntry> takes = takes_of(*left);
      ASSERT_GE(takes.size(), 1U);
      EXPECT_EQ(takes.back().number, 2U);
      for (const TakeEntry& take : takes)
        EXPECT_EQ(take.state, TakeState::kComplete) << take.number << ": " << take.problem;
      whole += takes.size() == 2 ? 1 : 0;
      gone += takes.size() == 1 ? 1 : 0;
      EXPECT_TRUE(!deleted || takes.size() == 1);
      EXPECT_EQ(left->list("000001").has_value(), takes.size() == 2) << "nothing of a deleted take is left";
    }
  }
  EXPECT_GT(whole, 0U);
  EXPECT_GT(gone, 0U);
}

TEST(TakeDelete, OneOperationOfTheDiskFails_TheErrorIsTheDisksAndTheSecondTimeItIsDeleted) {
  int failed = 0;
  for (std::uint64_t call = 0;; ++call) {
    SCOPED_TRACE("operation " + std::to_string(call));
    hal::sim::SimDisk disk;
    record_takes(disk);
    hal::sim::SimClock clock;
    TakeStage stage(disk, clock, {});
    const std::uint64_t before = disk.operations();
    disk.fail_at(before + call);
    const TakeAnswer first = stage.ask(TakeRequest::Delete{1});
    if (disk.operations() - before <= call) break;
    if (!first.result) {
      ++failed;
      EXPECT_EQ(first.result.error().code, Errc::kIo) << first.result.error().text();
      const TakeAnswer second = stage.ask(TakeRequest::Delete{1});
      EXPECT_TRUE(second.result || second.result.error().code == Errc::kNotFound) << second.result.error().text();
    }
    EXPECT_FALSE(disk.list("000001"));
    const std::vector<TakeEntry> takes = stage.list();
    ASSERT_EQ(takes.size(), 1U);
    EXPECT_EQ(takes[0].number, 2U);
  }
  EXPECT_GT(failed, 3);
}

TEST(TakeDelete, TheDiskIsFull_ATakeCanStillBeDeleted) {
  hal::sim::SimDisk disk;
  record_takes(disk);
  disk.set_capacity(1);
  hal::sim::SimClock clock;
  TakeStage stage(disk, clock, {});
  EXPECT_TRUE(stage.ask(TakeRequest::Delete{1}).result);
  EXPECT_EQ(stage.list().size(), 1U);
}

}  // namespace
}  // namespace nodal::firmware
