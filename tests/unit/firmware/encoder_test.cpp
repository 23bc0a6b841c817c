#include "firmware/encoder.h"

#include <gtest/gtest.h>

#include "hal/sim/clock.h"

namespace nodal::firmware {
namespace {

struct Encoding : ::testing::Test {
  /// What becomes of one raymap, and of its pixels.
  Raymap step() {
    auto pixels = std::make_shared<std::vector<std::uint8_t>>(packed_size(config.format, config.width, config.height));
    address = pixels->data();
    Raymap raymap;
    raymap.pixels = std::move(pixels);
    EXPECT_TRUE(blended.push(std::move(raymap)));
    EXPECT_TRUE(stage.step());
    return std::move(*stage.raymaps_out().pop());
  }

  RaymapConfig config;
  hal::sim::SimClock clock;
  SpscRing<Raymap> blended{2};
  SpscRing<Buffer> unread{4};
  EncodeStage stage{config, clock, blended, unread};
  const std::uint8_t* address = nullptr;
};

TEST_F(Encoding, NobodyPullsPixels_TheyGoBackToTheBlendAndTheJpegGoesOn) {
  stage.set_wanted(true, false);
  const Raymap raymap = step();
  EXPECT_FALSE(raymap.pixels);
  ASSERT_TRUE(raymap.jpeg);
  EXPECT_FALSE(raymap.jpeg->empty());
  const auto back = unread.pop();
  ASSERT_TRUE(back);
  EXPECT_EQ((*back)->data(), address);
}

TEST_F(Encoding, SomebodyPullsPixels_TheyGoOn) {
  for (const bool jpeg : {false, true}) {
    stage.set_wanted(jpeg, true);
    const Raymap raymap = step();
    ASSERT_TRUE(raymap.pixels);
    EXPECT_EQ(raymap.pixels->data(), address);
    EXPECT_EQ(raymap.jpeg != nullptr, jpeg);
    EXPECT_FALSE(unread.pop());
  }
}

}  // namespace
}  // namespace nodal::firmware
