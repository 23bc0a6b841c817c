// Ranges and matrices against their definitions in ITU-R BT.601 and BT.709, in double precision.
#include "stitch/decode/recode.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

namespace nodal::decode {
namespace {

struct Yuv {
  double y, u, v;
};

/// One pixel from its coding to full range BT.601, by way of R G B.
Yuv exact(const ColourCoding& coding, int y_level, int u_level, int v_level) {
  const double kr = coding.bt709 ? 0.2126 : 0.299;
  const double kb = coding.bt709 ? 0.0722 : 0.114;
  const double y = coding.video_range ? (y_level - 16) / 219.0 : y_level / 255.0;
  const double u = coding.video_range ? (u_level - 128) / 224.0 : (u_level - 128) / 255.0;
  const double v = coding.video_range ? (v_level - 128) / 224.0 : (v_level - 128) / 255.0;
  const double r = y + 2 * (1 - kr) * v;
  const double b = y + 2 * (1 - kb) * u;
  const double g = (y - kr * r - kb * b) / (1 - kr - kb);
  const double luma = 0.299 * r + 0.587 * g + 0.114 * b;
  return {255 * luma, 128 + 255 * (b - luma) / 1.772, 128 + 255 * (r - luma) / 1.402};
}
double in_range(double value) { return std::clamp(value, 0.0, 255.0); }

constexpr std::array kFormats{PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy,
                              PixelFormat::kI422};

class Codings : public testing::TestWithParam<ColourCoding> {};

TEST_P(Codings, EverySampleOfEveryFormat_IsWithinALevelOfTheDefinition) {
  std::mt19937 random(3);
  for (const PixelFormat format : kFormats) {
    for (const auto& [width, height] : {std::pair{64, 36}, {33, 7}}) {
      std::vector<std::uint8_t> bytes(packed_size(format, width, height));
      for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
      ImageView from = packed_image(format, width, height, std::as_const(bytes).data());
      from.coding = GetParam();
      std::vector<std::uint8_t> out(bytes.size(), 77);
      const MutableImageView into = packed_image(format, width, height, out.data());
      recode(from, into);
      const auto at = [](const auto& plane, int x, int y) {
        return int{plane.data[y * plane.row_stride + x * plane.pixel_stride]};
      };
      const int rows = component_grid(format, 1).step_y;
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          const Yuv expected = exact(GetParam(), at(from.planes[0], x, y), at(from.planes[1], x / 2, y / rows),
                                     at(from.planes[2], x / 2, y / rows));
          ASSERT_NEAR(at(into.planes[0], x, y), in_range(expected.y), 0.6)
              << pixel_format_name(format) << x << "," << y;
          ASSERT_NEAR(at(into.planes[1], x / 2, y / rows), in_range(expected.u), 0.6) << pixel_format_name(format);
          ASSERT_NEAR(at(into.planes[2], x / 2, y / rows), in_range(expected.v), 0.6) << pixel_format_name(format);
        }
      }
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Recode, Codings,
                         testing::Values(ColourCoding{false, false}, ColourCoding{true, false},
                                         ColourCoding{false, true}, ColourCoding{true, true}));

TEST(Recode, BlackWhiteAndGreyOfVideoRange_AreExact) {
  for (const bool bt709 : {false, true}) {
    const std::vector<std::uint8_t> bytes{16, 128, 235, 128, 126, 128, 0, 128};  // YUYV
    ImageView from = packed_image(PixelFormat::kYuyv, 4, 1, bytes.data());
    from.coding = {true, bt709};
    std::vector<std::uint8_t> out(8);
    recode(from, packed_image(PixelFormat::kYuyv, 4, 1, out.data()));
    EXPECT_EQ(out, (std::vector<std::uint8_t>{0, 128, 255, 128, 128, 128, 0, 128}));
  }
}

}  // namespace
}  // namespace nodal::decode
