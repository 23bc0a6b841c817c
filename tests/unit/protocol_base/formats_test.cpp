// Every pixel format, from the layouts in the kernel's V4L2 documentation and in IIDC 1.31: names, planes, sizes.
#include <gtest/gtest.h>

#include <optional>
#include <string_view>
#include <vector>

#include "protocol/base/image.h"

namespace nodal {
namespace {

using enum PixelFormat;

struct Format {
  PixelFormat format;
  std::string_view name;
  bool chroma, bayer, raymap;
  int components;
  std::size_t bytes_of_5_by_3;
  PixelFormat in_8_bits;
};

const std::vector<Format>& formats() {
  static const std::vector<Format> all{
      {kGrey8, "GREY", false, false, true, 1, 15, kGrey8},
      {kI420, "I420", true, false, true, 3, 15 + 2 * 6, kI420},
      {kNv12, "NV12", true, false, true, 3, 15 + 2 * 6, kNv12},
      {kYuyv, "YUYV", true, false, false, 3, 3 * 12, kYuyv},
      {kUyvy, "UYVY", true, false, false, 3, 3 * 12, kUyvy},
      {kRgb24, "RGB24", false, false, true, 3, 45, kRgb24},
      {kMjpeg, "MJPEG", false, false, false, 1, 0, kMjpeg},
      {kGrey16, "GREY16", false, false, true, 1, 30, kGrey8},
      {kRgb48, "RGB48", false, false, true, 3, 90, kRgb24},
      {kI422, "I422", true, false, false, 3, 15 + 2 * 9, kI422},
      {kRggb8, "RGGB8", false, true, false, 1, 15, kRggb8},
      {kGrbg8, "GRBG8", false, true, false, 1, 15, kGrbg8},
      {kGbrg8, "GBRG8", false, true, false, 1, 15, kGbrg8},
      {kBggr8, "BGGR8", false, true, false, 1, 15, kBggr8},
      {kYuv411, "YUV411", true, false, false, 1, 3 * 12, kYuv411},
  };
  return all;
}

TEST(PixelFormats, Each_HasTheKindAndSizeOfItsLayout) {
  for (const Format& f : formats()) {
    EXPECT_EQ(pixel_format_name(f.format), f.name);
    EXPECT_EQ(pixel_format_named(f.name), f.format) << f.name;
    EXPECT_EQ(has_chroma(f.format), f.chroma) << f.name;
    EXPECT_EQ(is_bayer(f.format), f.bayer) << f.name;
    EXPECT_EQ(is_raymap_format(f.format), f.raymap) << f.name;
    EXPECT_EQ(is_linear16(f.format), f.format != f.in_8_bits) << f.name;
    EXPECT_EQ(in_8_bits(f.format), f.in_8_bits) << f.name;
    EXPECT_EQ(component_count(f.format), f.components) << f.name;
    EXPECT_EQ(packed_size(f.format, 5, 3), f.bytes_of_5_by_3) << f.name;
  }
  EXPECT_EQ(pixel_format_named("YV12"), std::nullopt);
}

// image.h: as it is delivered if the blend can read it, or what each picture is decoded to.
TEST(BlendedFormat, OfEachDeliveredFormat_IsWhatTheBlendReadsForThisRaymap) {
  for (const PixelFormat raymap : {kI420, kNv12}) {
    for (const PixelFormat as_it_is : {kI420, kNv12, kYuyv, kUyvy, kI422}) {
      EXPECT_EQ(blended_format(as_it_is, raymap), as_it_is);
    }
    for (const PixelFormat decoded : {kMjpeg, kRggb8, kGrbg8, kGbrg8, kBggr8}) {
      EXPECT_EQ(blended_format(decoded, raymap), kI420);
    }
    EXPECT_EQ(blended_format(kYuv411, raymap), kI422);
    EXPECT_EQ(blended_format(kGrey8, raymap), std::nullopt);
    EXPECT_EQ(blended_format(kRgb24, raymap), std::nullopt);
  }
  for (const auto& [raymap, delivered] :
       {std::pair{kGrey8, kGrey8}, {kGrey16, kGrey8}, {kRgb24, kRgb24}, {kRgb48, kRgb24}}) {
    EXPECT_EQ(blended_format(delivered, raymap), delivered);
    EXPECT_EQ(blended_format(kMjpeg, raymap), delivered);
    EXPECT_EQ(blended_format(kGbrg8, raymap), delivered);
    EXPECT_EQ(blended_format(kYuv411, raymap), std::nullopt);
    EXPECT_EQ(blended_format(kNv12, raymap), std::nullopt);
  }
}

// Where sample (x, y) of each component lies in a packed picture of 5 by 3.
TEST(PackedImage, OfOddSize_EachSampleLiesWhereTheLayoutSays) {
  struct Place {
    PixelFormat format;
    int component, x, y;
    std::ptrdiff_t byte;
  };
  for (const Place& p :
       std::vector<Place>{{kGrey8, 0, 4, 2, 14},        {kRggb8, 0, 4, 2, 14},        {kI420, 0, 4, 2, 14},
                          {kI420, 1, 2, 1, 15 + 5},     {kI420, 2, 2, 1, 15 + 6 + 5}, {kNv12, 0, 4, 2, 14},
                          {kNv12, 1, 2, 1, 15 + 6 + 4}, {kNv12, 2, 2, 1, 15 + 6 + 5}, {kYuyv, 0, 3, 1, 12 + 6},
                          {kYuyv, 1, 1, 1, 12 + 4 + 1}, {kYuyv, 2, 1, 1, 12 + 4 + 3}, {kUyvy, 0, 3, 1, 12 + 7},
                          {kUyvy, 1, 1, 1, 12 + 4},     {kUyvy, 2, 1, 1, 12 + 4 + 2}, {kI422, 0, 4, 2, 14},
                          {kI422, 1, 2, 2, 15 + 8},     {kI422, 2, 2, 2, 15 + 9 + 8}, {kRgb24, 0, 4, 2, 42},
                          {kRgb24, 1, 4, 2, 43},        {kRgb24, 2, 4, 2, 44},        {kGrey16, 0, 4, 2, 28},
                          {kRgb48, 0, 4, 2, 84},        {kRgb48, 1, 4, 2, 86},        {kRgb48, 2, 4, 2, 88},
                          {kYuv411, 0, 11, 2, 24 + 11}}) {
    const std::vector<std::uint8_t> bytes(packed_size(p.format, 5, 3));
    const PlaneView plane = packed_image(p.format, 5, 3, bytes.data()).planes[static_cast<std::size_t>(p.component)];
    EXPECT_EQ(plane.data - bytes.data() + p.y * plane.row_stride + p.x * plane.pixel_stride, p.byte)
        << pixel_format_name(p.format) << ", component " << p.component;
    EXPECT_LT(p.x, plane.width) << pixel_format_name(p.format);
    EXPECT_LT(p.y, plane.height) << pixel_format_name(p.format);
  }
  EXPECT_EQ(packed_image(kNv12, 5, 3, static_cast<const std::uint8_t*>(nullptr)).planes[1].data, nullptr)
      << "a shape without memory";
}

// Chroma between the pixels (JPEG) or on the even ones (V4L2, "colour siting"); u_plane = u / step + offset.
TEST(ComponentGrid, OfChroma_IsAtTheSitesOfItsFormat) {
  for (const PixelFormat format : {kI420, kNv12}) {
    const PlaneGrid grid = component_grid(format, 1);
    EXPECT_EQ(1.0 / grid.step_x + grid.offset_x, 0.5) << "sample 0 is at 1, between pixels 0 and 1";
    EXPECT_EQ(1.0 / grid.step_y + grid.offset_y, 0.5);
  }
  for (const PixelFormat format : {kYuyv, kUyvy, kI422}) {
    for (const int c : {1, 2}) {
      const PlaneGrid grid = component_grid(format, c);
      EXPECT_EQ(0.5 / grid.step_x + grid.offset_x, 0.5) << "sample 0 is at the centre of pixel 0";
      EXPECT_EQ(2.5 / grid.step_x + grid.offset_x, 1.5) << "sample 1 is at the centre of pixel 2";
      EXPECT_EQ(0.5 / grid.step_y + grid.offset_y, 0.5);
    }
    EXPECT_EQ(component_grid(format, 0).step_x, 1);
  }
  EXPECT_EQ(component_grid(kRgb24, 2).step_x, 1);
  EXPECT_EQ(halved_chroma_grid(kI422, 0, {}).step_y, 1) << "luma keeps all rows";
}

}  // namespace
}  // namespace nodal
