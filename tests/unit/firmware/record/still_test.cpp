#include "firmware/record/still.h"

#include <gtest/gtest.h>

namespace nodal::firmware {
namespace {

constexpr std::size_t kHeads = 2;
constexpr Duration kPeriod = Duration::milliseconds(100);

FrameSet set_at(Duration time, HeadMask heads, std::uint64_t number = 7) {
  FrameSet set;
  set.number = number;
  set.mid_exposure = Instant() + time;
  set.period = kPeriod;
  set.mask = heads;
  return set;
}
FrameSet whole(Duration time, std::uint64_t number = 7) { return set_at(time, head_bit(0) | head_bit(1), number); }
FrameSet half(Duration time) { return set_at(time, head_bit(0)); }

TEST(Still, NoStill_EverySetAndRaymapIsRecordedAndNothingEndsTheTake) {
  Still still(kHeads, 1);
  still.begin(false, true);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(still.use_of(half(kPeriod * k)), Still::Use::kRecord);
    EXPECT_FALSE(still.on_recorded(half(kPeriod * k)));
    EXPECT_TRUE(still.takes_raymap(1));
    EXPECT_FALSE(still.on_raymap());
  }
}

TEST(Still, ASetWithoutAHead_IsLeftOutUntilOneIsWhole) {
  Still still(kHeads, 1);
  still.begin(true, false);
  EXPECT_EQ(still.use_of(half(Duration())), Still::Use::kLeaveOut);
  EXPECT_EQ(still.use_of(whole(kPeriod)), Still::Use::kRecord);
  EXPECT_TRUE(still.on_recorded(whole(kPeriod))) << "without raymaps, it needs nothing more";
}

TEST(Still, NoSetIsWhole_TheNextAfterTheWaitIsTaken) {
  Still still(kHeads, 1);
  still.begin(true, false);
  const Duration wait = Still::kWaits.at(kPeriod);
  EXPECT_EQ(still.use_of(half(Duration())), Still::Use::kLeaveOut);
  EXPECT_EQ(still.use_of(half(wait - Duration::nanoseconds(1))), Still::Use::kLeaveOut);
  EXPECT_EQ(still.use_of(half(wait)), Still::Use::kRecord);
}

TEST(Still, WithTwoRaymapsASet_EndsAfterTheSecondOfItsOwnSet) {
  Still still(kHeads, 2);
  still.begin(true, true);
  EXPECT_FALSE(still.takes_raymap(7)) << "before its set";
  ASSERT_EQ(still.use_of(whole(Duration(), 7)), Still::Use::kRecord);
  EXPECT_FALSE(still.on_recorded(whole(Duration(), 7)));
  EXPECT_EQ(still.use_of(whole(kPeriod, 8)), Still::Use::kLeaveOut);
  EXPECT_FALSE(still.takes_raymap(8));
  EXPECT_TRUE(still.takes_raymap(7));
  EXPECT_FALSE(still.on_raymap());
  EXPECT_TRUE(still.on_raymap());
}

TEST(Still, ItsRaymapsDoNotCome_EndsAfterTheWait) {
  Still still(kHeads, 1);
  still.begin(true, true);
  const Duration wait = Still::kWaits.at(kPeriod);
  ASSERT_FALSE(still.on_recorded(whole(kPeriod)));
  EXPECT_EQ(still.use_of(whole(kPeriod + wait - Duration::nanoseconds(1), 8)), Still::Use::kLeaveOut);
  EXPECT_EQ(still.use_of(whole(kPeriod + wait, 9)), Still::Use::kEnd);
}

}  // namespace
}  // namespace nodal::firmware
