#include "firmware/operate/shedding.h"

#include <gtest/gtest.h>

namespace nodal::firmware {
namespace {

class SheddingTest : public testing::Test {
 protected:
  /// Seconds with 30 sets each, of which the blend takes `taken`.
  void seconds(int n, int taken, bool excused = false) {
    for (int i = 0; i < n * 30; ++i) {
      now = now + Duration::microseconds(33'334);
      ++sets;
      if (i % 30 >= taken) ++not_taken;
      shedding.step(sets, not_taken, excused, FrameRate().period(), now);
    }
  }
  Shedding shedding;
  Instant now;
  std::uint64_t sets = 0;
  std::uint64_t not_taken = 0;
};

TEST_F(SheddingTest, EnoughTime_NothingIsShed) {
  seconds(60, 30);
  EXPECT_EQ(shedding.level(), ShedLevel{});
  seconds(1, 10);
  seconds(10, 30);
  EXPECT_EQ(shedding.level(), ShedLevel{}) << "one bad second is a hiccup";
}

TEST_F(SheddingTest, OverloadThatStays_ShedsPublishingToTheEndBeforeThePreview) {
  ShedLevel before;
  for (int i = 0; i < 60; ++i) {
    seconds(1, 20);
    const ShedLevel& level = shedding.level();
    EXPECT_GE(level.publish_every, before.publish_every);
    EXPECT_TRUE(level.preview_every == 1 || level.publish_every == kShedLevels.back().publish_every);
    before = level;
  }
  EXPECT_EQ(before, kShedLevels.back());
}

TEST_F(SheddingTest, OverloadThatPasses_EverythingIsDoneAgain) {
  seconds(3, 20);
  EXPECT_EQ(shedding.level().publish_every, 2U);
  seconds(Shedding::kPatience + 2, 30);
  EXPECT_EQ(shedding.level(), ShedLevel{});
}

TEST_F(SheddingTest, ABoardThatCanDoJustSoMuch_TriesEverMoreSeldom) {
  int changes = 0;
  std::uint32_t level = 1;
  for (int i = 0; i < 600; ++i) {
    seconds(1, shedding.level().publish_every > 1 ? 30 : 20);
    changes += shedding.level().publish_every != level ? 1 : 0;
    level = shedding.level().publish_every;
  }
  EXPECT_GE(changes, 4);
  EXPECT_LE(changes, 30) << "ten minutes with a patience of 5, 10, 20, 40 and 80 s";
}

TEST_F(SheddingTest, WhileTheRateSaysNothingOfTheBoard_NothingIsShed) {
  seconds(60, 10, true);
  EXPECT_EQ(shedding.level(), ShedLevel{});
}

}  // namespace
}  // namespace nodal::firmware
