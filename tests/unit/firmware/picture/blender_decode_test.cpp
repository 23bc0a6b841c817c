// Heads whose frames are decoded before the blend.
#include <gtest/gtest.h>

#include <thread>

#include "blender_fixture.h"
#include "stitch/decode/jpeg_frame.h"
#include "tests/support/pictures.h"

namespace nodal::firmware {
namespace {

/// Heads that deliver JPEGs of `pictures`; `decoded` are these JPEGs' pictures.
class JpegHeads : public BlenderTest {
 protected:
  JpegHeads() {
    decode::JpegDecoder decoder;
    for (std::size_t i = 0; i < kHeads; ++i) {
      jpegs[i] = test::jpeg_of(pictures[i], kSide, kSide, test::Sampling::k444);
      decoded[i].resize(pictures[i].size());
      const auto into = packed_image(PixelFormat::kRgb24, kSide, kSide, decoded[i].data());
      EXPECT_EQ(decoder.decode(jpegs[i], into), decode::DecodeFault::kNone);
    }
    install(calibration);
  }
  FrameSet jpeg_set(std::uint64_t number) const {
    FrameSet set;
    set.number = number;
    for (std::size_t i = 0; i < kHeads; ++i) {
      set.mask |= head_bit(i);
      set.frames[i].image = {PixelFormat::kMjpeg, kSide, kSide, {}, jpegs[i].size()};
      set.frames[i].image.planes[0].data = jpegs[i].data();
    }
    return set;
  }
  /// The raymap of the decoded pictures of these heads.
  LineVector expected(HeadMask heads) {
    FrameSet set;
    set.mask = heads;
    for (std::size_t i = 0; i < kHeads; ++i) {
      set.frames[i].image = packed_image(PixelFormat::kRgb24, kSide, kSide, std::as_const(decoded[i]).data());
    }
    return whole(set, *calibration.plan);
  }
  std::array<std::vector<std::uint8_t>, kHeads> jpegs;
  std::array<std::vector<std::uint8_t>, kHeads> decoded;
  const sets::BlendSetup calibration = installed("jpegs", 1, std::vector(kHeads, PixelFormat::kMjpeg));
};

TEST_F(JpegHeads, ASet_IsTheRaymapOfItsDecodedPictures) {
  blend(jpeg_set(0));
  const auto raymap = blender.raymaps_out().pop();
  ASSERT_TRUE(raymap);
  EXPECT_EQ(raymap->info.heads, 0b1111u);
  EXPECT_EQ(*raymap->pixels, expected(0b1111));
  EXPECT_EQ(held(), 0u);
}

TEST_F(JpegHeads, OneThatCannotBeDecoded_CountsAsMissingIsCountedAndTheNextIsGoodAgain) {
  FrameSet set = jpeg_set(0);
  set.frames[2].image.bytes /= 2;
  blend(set);
  auto raymap = blender.raymaps_out().pop();
  ASSERT_TRUE(raymap);
  EXPECT_EQ(raymap->info.heads, 0b1011u);
  EXPECT_EQ(*raymap->pixels, expected(0b1011));
  EXPECT_EQ(blender.undecodable(2).frames.load(), 1u);
  EXPECT_EQ(blender.undecodable(2).now.load(), decode::DecodeFault::kBroken);
  EXPECT_EQ(blender.undecodable(1).frames.load(), 0u);
  blend(jpeg_set(1));
  raymap = blender.raymaps_out().pop();
  ASSERT_TRUE(raymap);
  EXPECT_EQ(*raymap->pixels, expected(0b1111));
  EXPECT_EQ(blender.undecodable(2).now.load(), decode::DecodeFault::kNone);
  EXPECT_EQ(blender.undecodable(2).frames.load(), 1u);
}

TEST_F(JpegHeads, OnFourThreads_TheBytesAreTheSame) {
  const LineVector once = expected(0b1111);
  for (std::uint64_t i = 0; i < 50; ++i) {
    lend(jpeg_set(i));
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([&] {
        while (!blender.idle()) blender.step();
      });
    }
    blender.step();
    threads.clear();
    while (blender.step()) {}
    const auto raymap = blender.raymaps_out().pop();
    ASSERT_TRUE(raymap);
    ASSERT_EQ(*raymap->pixels, once);
  }
}

TEST_F(JpegHeads, NoneCanBeDecoded_TheRaymapIsBlackAndTheSetGoesBack) {
  FrameSet set = jpeg_set(0);
  for (std::size_t i = 0; i < kHeads; ++i) set.frames[i].image.bytes = 3;
  blend(set);
  const auto raymap = blender.raymaps_out().pop();
  ASSERT_TRUE(raymap);
  EXPECT_EQ(raymap->info.heads, 0u);
  EXPECT_EQ(*raymap->pixels, expected(0));
  EXPECT_EQ(held(), 0u);
}

}  // namespace
}  // namespace nodal::firmware
