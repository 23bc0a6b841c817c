#include "firmware/capture/set_assembly.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <utility>
#include <vector>

namespace nodal::firmware {
namespace {

constexpr OutletSpec kOneReader{"reader", OutletPolicy::kLossless, 1, 1};

class SetAssemblyTest : public testing::Test {
 protected:
  SetAssemblyTest() { assembly_.begin_step(); }
  /// Opens a set of this slot with the frames of these heads.
  void open(SetClock::Slot slot, HeadMask heads = head_bit(0)) {
    SetAssembly::OpenSet* const set = assembly_.open(slot);
    ASSERT_TRUE(set);
    set->set.edit().mask = heads;
  }
  SetClock::Slot close() { return assembly_.close_oldest().slot; }

  std::vector<std::pair<HeadMask, std::uint32_t>> returned_;  ///< heads of a set that came back, and the collection
  SetAssembly assembly_{[this](FrameSet& set, std::uint32_t collection) {
    returned_.emplace_back(std::exchange(set.mask, 0), collection);
  }};
  Outlet<SetLoan>& reader_ = assembly_.add_outlet(kOneReader, true);
};

TEST_F(SetAssemblyTest, SetsOpenedInAnyOrder_AreClosedByTheirSlots) {
  for (const SetClock::Slot slot : {7, 5, 8, 6}) open(slot);
  EXPECT_EQ(assembly_.find(6)->slot, 6);
  EXPECT_FALSE(assembly_.find(9));
  EXPECT_EQ(assembly_.oldest().slot, 5);
  EXPECT_FALSE(assembly_.newest_closed());
  for (const SetClock::Slot slot : {5, 6, 7, 8}) {
    EXPECT_EQ(close(), slot);
    EXPECT_EQ(assembly_.newest_closed(), slot);
  }
  EXPECT_TRUE(assembly_.empty());
}

TEST_F(SetAssemblyTest, AsManyAsMayBeOpen_ANewerSlotNeedsTheOldestClosedAndAnOlderOneHasNoPlace) {
  for (SetClock::Slot slot = 5; slot < 9; ++slot) {
    EXPECT_FALSE(assembly_.must_close_for(slot));
    open(slot);
  }
  EXPECT_TRUE(assembly_.must_close_for(9));
  EXPECT_FALSE(assembly_.must_close_for(4));
  EXPECT_FALSE(assembly_.open(4));
  close();
  EXPECT_TRUE(assembly_.open(9));
}

TEST_F(SetAssemblyTest, FramesHeld_AreThoseOfOpenSetsOnly) {
  open(1, head_bit(0) | head_bit(2) | head_bit(5));
  open(2, head_bit(1));
  EXPECT_EQ(assembly_.held(), 4u);
  const SetAssembly::OpenSet closed = assembly_.close_oldest();
  EXPECT_EQ(assembly_.held(), 1u);
  assembly_.close_oldest();
}

TEST_F(SetAssemblyTest, ASet_ComesBackWhenItsLastReaderHasReleasedIt) {
  open(1, head_bit(3));
  assembly_.offer(assembly_.close_oldest().set);
  EXPECT_FALSE(assembly_.collect()) << "it waits for its reader";
  auto read = reader_.take();
  ASSERT_TRUE(read);
  EXPECT_FALSE(assembly_.collect()) << "it is being read";
  read.reset();
  assembly_.begin_step();
  EXPECT_TRUE(assembly_.collect());
  ASSERT_EQ(returned_.size(), 1u);
  EXPECT_EQ(returned_[0], std::pair(head_bit(3), 1u)) << "in the first collection of the step";
}

TEST_F(SetAssemblyTest, AReaderThatHoldsMoreThanItRegisteredFor_LeavesNoSet) {
  // Four open, one more for the order of opening and closing, and what the reader holds.
  std::vector<SetLoan> kept;
  for (SetClock::Slot slot = 0; slot < static_cast<SetClock::Slot>(4 + held_at_most(kOneReader) + 1); ++slot) {
    open(slot);
    kept.push_back(assembly_.close_oldest().set);
  }
  EXPECT_FALSE(assembly_.open(100));
  kept.pop_back();
  EXPECT_TRUE(assembly_.open(100));
  assembly_.close_oldest();
}

TEST_F(SetAssemblyTest, EvidenceOfTheSetBefore_IsGoneFromAUsedOne) {
  SetAssembly::OpenSet* const used = assembly_.open(1);
  used->set.edit().sync.trigger = 77;
  assembly_.close_oldest();
  EXPECT_FALSE(assembly_.open(2)->set->sync.trigger);
  assembly_.close_oldest();
}

}  // namespace
}  // namespace nodal::firmware
