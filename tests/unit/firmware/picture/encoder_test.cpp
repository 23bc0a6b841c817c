#include "firmware/picture/encoder.h"

#include <gtest/gtest.h>

#include "hal/sim/clock.h"

namespace nodal::firmware {
namespace {

struct Encoding : ::testing::Test {
  /// Encodes one raymap; returns it with its pixels.
  Raymap step() {
    Raymap raymap;
    raymap.pixels = pool.take();
    raymap.pixels.edit().resize(packed_size(config.format, config.width, config.height));
    address = raymap.pixels->data();
    EXPECT_TRUE(blended.push(std::move(raymap)));
    EXPECT_TRUE(stage.step());
    return *stage.published().take();
  }

  RaymapConfig config;
  hal::sim::SimClock clock;
  SpscRing<Raymap> blended{2};
  LoanPool<LineVector> pool{4};
  EncodeStage stage{config, clock, blended};
  const std::uint8_t* address = nullptr;
};

TEST_F(Encoding, NobodyPullsPixels_TheyAreGivenUpAndTheJpegGoesOn) {
  stage.set_wanted(true, false);
  const Raymap raymap = step();
  EXPECT_FALSE(raymap.pixels);
  ASSERT_TRUE(raymap.jpeg);
  EXPECT_FALSE(raymap.jpeg->empty());
  pool.collect();
  EXPECT_EQ(pool.lent(), 0u);
}

TEST_F(Encoding, SomebodyPullsPixels_TheyGoOn) {
  for (const bool jpeg : {false, true}) {
    stage.set_wanted(jpeg, true);
    const Raymap raymap = step();
    ASSERT_TRUE(raymap.pixels);
    EXPECT_EQ(raymap.pixels->data(), address);
    EXPECT_EQ(static_cast<bool>(raymap.jpeg), jpeg);
    pool.collect();
    EXPECT_EQ(pool.lent(), 1u);
  }
}

// A second outlet, first slow, then stuck: the publisher loses nothing, and the outlet's losses are counted.
TEST_F(Encoding, SecondOutletSlowThenStuck_ThePublisherLosesNothingAndTheLossesAreCounted) {
  Outlet<Raymap>& slow = stage.add_outlet({"slow", OutletPolicy::kLossless, 2, 1});
  Outlet<Raymap>& newest = stage.add_outlet({"newest", OutletPolicy::kLatest, 2, 1});
  stage.set_wanted(false, false);
  std::uint64_t read = 0, expected_next = 0, newest_read = 0;
  for (std::uint64_t i = 0; i < 60; ++i) {
    Raymap raymap;
    raymap.info.set = i;
    ASSERT_TRUE(blended.push(std::move(raymap)));
    ASSERT_TRUE(stage.step());
    const auto published = stage.published().take();
    ASSERT_TRUE(published);
    EXPECT_EQ(published->info.set, i);
    if (i >= 30 || i % 3 != 2) continue;  // reads every third raymap, then none
    const auto kept = slow.take();
    ASSERT_TRUE(kept);
    EXPECT_GE(kept->info.set, expected_next);
    expected_next = kept->info.set + 1;
    ++read;
    const auto last = newest.take();
    ASSERT_TRUE(last);
    EXPECT_EQ(last->info.set, i - 1) << "two wait, and the third is missed";
    ++newest_read;
  }
  EXPECT_EQ(slow.losses().full + slow.losses().replaced + read + 2, 60u) << "two still wait";
  EXPECT_EQ(newest.losses().full + newest.losses().replaced + newest_read + 2, 60u);
  EXPECT_EQ(newest.losses().replaced, newest_read);
  EXPECT_EQ(stage.published().losses().full, 0u);
}

}  // namespace
}  // namespace nodal::firmware
