// How a V4L2 driver lays a picture out in memory.
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

/// A format by V4L2's four characters.
struct FourCc {
  std::uint32_t code = 0;
  PixelFormat pixels = PixelFormat::kGrey8;
  int memory_planes = 1;  ///< buffers that a frame consists of; more than 1 with the multi-planar API only
};

/// What can deliver `pixels`, the best first.
std::vector<FourCc> fourccs_of(PixelFormat pixels);
/// "YU12 (Planar YUV)": the characters, and those that are not printable as '?'.
std::string fourcc_text(std::uint32_t code);

/// Where each component's samples lie.
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

/// `strides` are bytes of a row of each memory plane.
/// Errors: kDeviceFailed when a stride is too small for the width, or a size is not possible.
Result<Layout> make_layout(const FourCc& format, int width, int height, std::span<const std::uint32_t> strides);

/// The picture whose memory planes start at `planes`, each of at least `needed` bytes.
MutableImageView view_of(const Layout& layout, std::span<std::uint8_t* const> planes);

}  // namespace nodal::hal::v4l2
