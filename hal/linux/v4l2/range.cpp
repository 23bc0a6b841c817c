#include "hal/linux/v4l2/range.h"

#include <algorithm>

namespace nodal::hal::v4l2 {
namespace {

std::uint8_t clipped(int value) { return static_cast<std::uint8_t>(std::clamp(value, 0, 255)); }

/// (y - 16) * 255 / 219 = d + d * 36 / 219, and 36 / 219 is 42 / 256 to 0.0003.
std::uint8_t luma(std::uint8_t sample) {
  const int d = std::max(int{sample} - 16, 0);
  return clipped(d + ((d * 42 + 128) >> 8));
}

/// (c - 128) * 255 / 224 + 128, and 31 / 224 is 71 / 512 to 0.0003.
std::uint8_t chroma(std::uint8_t sample) {
  const int d = int{sample} - 128;
  return clipped(128 + d + ((d * 71 + 256) >> 9));
}

template <int kStride, std::uint8_t (*kConvert)(std::uint8_t)>
void convert_row(std::uint8_t* row, int width) {
  for (int x = 0; x < width; ++x) row[x * kStride] = kConvert(row[x * kStride]);
}

template <std::uint8_t (*kConvert)(std::uint8_t)>
void convert(const MutablePlaneView& plane) {
  for (int y = 0; y < plane.height; ++y) {
    std::uint8_t* const row = plane.data + y * plane.row_stride;
    switch (plane.pixel_stride) {
      case 1: convert_row<1, kConvert>(row, plane.width); break;
      case 2: convert_row<2, kConvert>(row, plane.width); break;
      default: convert_row<4, kConvert>(row, plane.width); break;
    }
  }
}

}  // namespace

void expand_video_range(const MutableImageView& picture) {
  if (picture.format == PixelFormat::kRgb24) return;
  convert<luma>(picture.planes[0]);
  if (!has_chroma(picture.format)) return;
  convert<chroma>(picture.planes[1]);
  convert<chroma>(picture.planes[2]);
}

}  // namespace nodal::hal::v4l2
