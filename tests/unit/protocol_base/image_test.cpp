#include "protocol/base/image.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace nodal {
namespace {

class EveryPackedFormat : public ::testing::TestWithParam<PixelFormat> {};

// Every byte of the picture belongs to exactly one sample (YUYV and UYVY: even widths).
TEST_P(EveryPackedFormat, EverySampleHasItsOwnByteInsideThePicture) {
  const int width = 6;
  const int height = 4;
  std::vector<std::uint8_t> bytes(packed_size(GetParam(), width, height));
  const ImageView image = packed_image(GetParam(), width, height, std::as_const(bytes).data());
  std::set<std::ptrdiff_t> seen;
  for (int c = 0; c < component_count(GetParam()); ++c) {
    const PlaneView& plane = image.planes[static_cast<std::size_t>(c)];
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x) {
        const std::ptrdiff_t at = plane.data + y * plane.row_stride + x * plane.pixel_stride - bytes.data();
        EXPECT_GE(at, 0);
        EXPECT_LT(at, static_cast<std::ptrdiff_t>(bytes.size()));
        EXPECT_TRUE(seen.insert(at).second);
      }
    }
  }
  EXPECT_EQ(seen.size(), bytes.size());
}

INSTANTIATE_TEST_SUITE_P(All, EveryPackedFormat,
                         ::testing::Values(PixelFormat::kGrey8, PixelFormat::kI420, PixelFormat::kNv12,
                                           PixelFormat::kYuyv, PixelFormat::kUyvy, PixelFormat::kRgb24),
                         [](const auto& format) { return std::string(pixel_format_name(format.param)); });

TEST(PackedImage, Yuyv_LumaFirstThenUThenV) {
  const std::vector<std::uint8_t> bytes{10, 128, 11, 129};
  const ImageView image = packed_image(PixelFormat::kYuyv, 2, 1, bytes.data());
  EXPECT_EQ(image.planes[0].data[0], 10);
  EXPECT_EQ(image.planes[0].data[image.planes[0].pixel_stride], 11);
  EXPECT_EQ(image.planes[1].data[0], 128);
  EXPECT_EQ(image.planes[2].data[0], 129);
}

TEST(HalvedChroma, RowsOfPackedPictures_AreEverySecondAndLieWhereTheyDid) {
  for (const PixelFormat format : {PixelFormat::kYuyv, PixelFormat::kUyvy}) {
    std::vector<std::uint8_t> bytes(packed_size(format, 8, 5));
    const ImageView all = packed_image(format, 8, 5, std::as_const(bytes).data());
    const ImageView half = halved_chroma(all);
    EXPECT_EQ(half.planes[0].height, 5);
    EXPECT_EQ(half.planes[0].row_stride, all.planes[0].row_stride);
    for (int c = 1; c < 3; ++c) {
      const PlaneView& plane = half.planes[static_cast<std::size_t>(c)];
      EXPECT_EQ(plane.height, 3) << "rows 0, 2 and 4";
      const PlaneGrid every = component_grid(format, c);
      const PlaneGrid second = halved_chroma_grid(format, c, every);
      for (int k = 0; k < plane.height; ++k) {
        EXPECT_EQ(plane.data + k * plane.row_stride, all.planes[static_cast<std::size_t>(c)].data +
                                                         2 * k * all.planes[static_cast<std::size_t>(c)].row_stride);
        const double on_picture = (2 * k + 0.5 - every.offset_y) * every.step_y;
        EXPECT_DOUBLE_EQ((k + 0.5 - second.offset_y) * second.step_y, on_picture);
      }
      EXPECT_EQ(second.step_x, every.step_x);
      EXPECT_EQ(second.offset_x, every.offset_x);
    }
  }
}

TEST(HalvedChroma, PicturesWhoseChromaIsHalfAlready_StayAsTheyAre) {
  std::vector<std::uint8_t> bytes(packed_size(PixelFormat::kNv12, 8, 6));
  const ImageView all = packed_image(PixelFormat::kNv12, 8, 6, std::as_const(bytes).data());
  EXPECT_EQ(halved_chroma(all).planes[1].height, all.planes[1].height);
  EXPECT_EQ(halved_chroma(all).planes[1].row_stride, all.planes[1].row_stride);
}

}  // namespace
}  // namespace nodal
