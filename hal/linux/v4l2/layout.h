// The memory layout of pictures from V4L2 drivers.
#pragma once

#include <linux/videodev2.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/result.h"

namespace nodal::hal::v4l2 {

/// A format by its V4L2 four-character code.
struct FourCc {
  std::uint32_t code = 0;
  PixelFormat pixels = PixelFormat::kGrey8;
  int memory_planes = 1;  ///< buffers per frame; more than 1 only with the multi-planar API
};

/// The formats that can deliver `pixels`, best first.
std::vector<FourCc> fourccs_of(PixelFormat pixels);
/// For example "YU12 (Planar YUV)"; characters that are not printable are shown as '?'.
std::string fourcc_text(std::uint32_t code);

/// The position of every component's samples.
struct Layout {
  struct Component {
    int memory_plane = 0;
    std::size_t offset = 0;
    int width = 0;
    int height = 0;
    std::ptrdiff_t row_stride = 0;
    int pixel_stride = 1;
  };
  PixelFormat pixels = PixelFormat::kGrey8;
  int width = 0;
  int height = 0;
  int memory_planes = 1;
  std::array<Component, kMaxPlanes> components{};
  std::array<std::size_t, kMaxPlanes> needed{};  ///< bytes that each memory plane must hold
};

/// `strides` are the bytes per row of each memory plane.
/// Errors: kDeviceFailed if a stride is too small for the width, or a size is impossible.
Result<Layout> make_layout(const FourCc& format, int width, int height, std::span<const std::uint32_t> strides);

/// A view of the picture whose memory planes start at `planes`, each with at least `needed` bytes. `used`: the length
/// of a JPEG.
ImageView view_of(const Layout& layout, std::span<const std::uint8_t* const> planes, std::size_t used);

}  // namespace nodal::hal::v4l2
