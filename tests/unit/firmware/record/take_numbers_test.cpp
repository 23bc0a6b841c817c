#include "firmware/record/take_numbers.h"

#include <gtest/gtest.h>

#include <string>

#include "firmware/record/takes_in_use.h"
#include "hal/sim/disk.h"

namespace nodal::firmware {
namespace {

void put_counter(hal::sim::SimDisk& disk, const std::string& text) {
  disk.put(kNextTakeFile, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

TEST(TakeNumbers, ANewNumber_IsAboveTheCounterAndAllTakesOnTheDisk) {
  hal::sim::SimDisk disk;
  put_counter(disk, "40");
  TakeNumbers numbers(disk);
  numbers.read_counter();
  numbers.set_highest(12);
  EXPECT_EQ(numbers.new_number().value(), 40u);
  numbers.set_highest(99);
  EXPECT_EQ(numbers.new_number().value(), 100u);
  EXPECT_EQ(numbers.new_number().value(), 101u);
}

TEST(TakeNumbers, ANumberThatWasGiven_IsNotGivenAfterThePowerFailed) {
  hal::sim::SimDisk disk;
  TakeNumbers numbers(disk);
  numbers.read_counter();
  const std::uint64_t given = numbers.new_number().value();
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const auto later = disk.after_power_loss(seed);
    TakeNumbers again(*later);
    again.read_counter();
    EXPECT_GT(again.new_number().value(), given);
  }
}

TEST(TakeNumbers, ACounterThatCannotBeRead_GivesNoNumber) {
  hal::sim::SimDisk disk;
  put_counter(disk, "40");
  disk.fail_reads(1);
  TakeNumbers numbers(disk);
  numbers.read_counter();
  EXPECT_EQ(numbers.new_number().error().code, Errc::kIo);
  numbers.read_counter();
  EXPECT_EQ(numbers.new_number().value(), 40u);
}

TEST(TakeNumbers, TheHighestNumber_IsAnErrorThatSaysWhatToMove) {
  hal::sim::SimDisk disk;
  TakeNumbers numbers(disk);
  numbers.read_counter();
  numbers.set_highest(TakeNumbers::kMax - 1);
  const auto number = numbers.new_number();
  ASSERT_FALSE(number);
  EXPECT_EQ(number.error().code, Errc::kTooLarge);
  EXPECT_NE(number.error().message.find("next-take"), std::string::npos);
}

TEST(TakesInUse, ATake_IsInUseWhileAReaderHasIt) {
  TakesInUse used;
  used.set(3, 12);
  used.set(4, 12);
  EXPECT_TRUE(used.contains(12));
  EXPECT_FALSE(used.contains(13));
  used.set(3, 0);
  EXPECT_TRUE(used.contains(12)) << "the other reader has it";
  used.set(4, 0);
  EXPECT_FALSE(used.contains(12));
}

TEST(TakesInUse, AnEject_WaitsForTheFileThatIsOpenAndLetsNoFurtherOneBegin) {
  TakesInUse used;
  ASSERT_TRUE(used.begin_read());
  used.set_ejected(true);
  EXPECT_TRUE(used.is_read());
  used.end_read();
  EXPECT_FALSE(used.is_read());
  EXPECT_FALSE(used.begin_read());
  EXPECT_FALSE(used.is_read()) << "the refused read is none";
  used.set_ejected(false);
  EXPECT_TRUE(used.begin_read());
}

}  // namespace
}  // namespace nodal::firmware
