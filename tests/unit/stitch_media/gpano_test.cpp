#include "stitch/media/gpano.h"

#include <gtest/gtest.h>

#include <numeric>

#include "protocol/base/image.h"

namespace nodal::media {
namespace {

DecodedImage numbered(PixelFormat format, int width, int height) {
  DecodedImage image{format, width, height, std::vector<std::uint8_t>(packed_size(format, width, height))};
  std::iota(image.bytes.begin(), image.bytes.end(), std::uint8_t{1});
  return image;
}

TEST(Gpano, WhatIsWritten_IsRead) {
  const auto area = read_gpano("bytes before" + gpano_packet(400, 200) + "bytes behind");
  ASSERT_TRUE(area);
  EXPECT_EQ(area->full_width, 400);
  EXPECT_EQ(area->height, 200);
  EXPECT_FALSE(read_gpano("GPano:ProjectionType=\"cylindrical\""));
  EXPECT_FALSE(read_gpano(""));
}

TEST(Gpano, Elements_AreReadAsAttributesAre) {
  const auto area = read_gpano(
      "<GPano:ProjectionType>equirectangular</GPano:ProjectionType><GPano:CroppedAreaLeftPixels>7"
      "</GPano:CroppedAreaLeftPixels><GPano:FullPanoHeightPixels>50</GPano:FullPanoHeightPixels>");
  ASSERT_TRUE(area);
  EXPECT_EQ(area->left, 7);
  EXPECT_EQ(area->full_height, 50);
  EXPECT_EQ(area->full_width, 0) << "not said";
}

TEST(Gpano, APart_IsPlacedOnTheSphereAndTheRestIsBlack) {
  for (const PixelFormat format : {PixelFormat::kGrey8, PixelFormat::kRgb24}) {
    const DecodedImage part = numbered(format, 3, 2);
    // Written for a picture of twice its size.
    const DecodedImage whole = whole_sphere(part, {16, 8, 4, 2, 6, 4}).value();
    ASSERT_EQ(whole.width, 8);
    ASSERT_EQ(whole.height, 4);
    const int channels = component_count(format);
    for (int y = 0; y < 4; ++y) {
      for (int x = 0; x < 8; ++x) {
        const bool there = x >= 2 && x < 5 && y >= 1 && y < 3;
        const int expected = there ? 1 + channels * (3 * (y - 1) + x - 2) : 0;
        EXPECT_EQ(whole.bytes[static_cast<std::size_t>(channels * (8 * y + x))], expected) << x << " " << y;
      }
    }
  }
}

TEST(Gpano, APartOf16Bits_IsPlacedWithBothBytes) {
  const DecodedImage part = numbered(PixelFormat::kRgb48, 3, 2);
  const DecodedImage whole = whole_sphere(part, {8, 4, 2, 1, 3, 2}).value();
  ASSERT_EQ(whole.bytes.size(), 8U * 4U * 6U);
  std::vector<std::uint8_t> expected(8U * 4U * 6U);
  for (std::ptrdiff_t y = 0; y < 2; ++y) {
    std::copy_n(part.bytes.begin() + y * 18, 18, expected.begin() + (8 * (y + 1) + 2) * 6);
  }
  EXPECT_EQ(whole.bytes, expected);
}

TEST(Gpano, AWholeSphereOrAnAreaThatIsNotSaid_LeavesThePictureAsItIs) {
  const DecodedImage part = numbered(PixelFormat::kGrey8, 4, 2);
  EXPECT_EQ(whole_sphere(part, {8, 4, 0, 0, 8, 4})->bytes, part.bytes);
  EXPECT_EQ(whole_sphere(part, {})->bytes, part.bytes);
}

TEST(Gpano, ImpossibleAreas_AreRefused) {
  const DecodedImage part = numbered(PixelFormat::kGrey8, 4, 2);
  constexpr std::int64_t kHuge = std::numeric_limits<std::int64_t>::max();
  for (const SphereArea& area : {SphereArea{8, 4, 5, 0, 4, 2},
                                 {8, 4, -1, 0, 4, 2},
                                 {8, 4, 0, 3, 4, 2},
                                 {8, 4, 0, 0, 9, 2},
                                 {8, 4, 0, 0, -4, 2},
                                 {kHuge, 4, 0, 0, 4, 2},
                                 {kHuge, kHuge, kHuge, kHuge, kHuge, kHuge},
                                 {8, -4, 0, 0, 4, 2}}) {
    EXPECT_EQ(whole_sphere(part, area).error().code, Errc::kBadFormat) << area.left << " " << area.width;
  }
  EXPECT_EQ(whole_sphere(part, {1 << 20, 1 << 20, 0, 0, 4, 2}).error().code, Errc::kTooLarge);
  EXPECT_EQ(whole_sphere(part, {std::int64_t{1} << 32, std::int64_t{1} << 32, 0, 0, 1, 1}).error().code,
            Errc::kTooLarge);
}

}  // namespace
}  // namespace nodal::media
