#include "hal/linux/v4l2/layout.h"

#include <fmt/format.h>

#include <algorithm>

namespace nodal::hal::v4l2 {
namespace {

constexpr int kLargestSide = 16384;
constexpr std::size_t kLargestStride = std::size_t{1} << 20;

}  // namespace

std::vector<FourCc> fourccs_of(PixelFormat pixels) {
  switch (pixels) {
    case PixelFormat::kI420: return {{V4L2_PIX_FMT_YUV420, pixels, 1}, {V4L2_PIX_FMT_YUV420M, pixels, 3}};
    case PixelFormat::kNv12: return {{V4L2_PIX_FMT_NV12, pixels, 1}, {V4L2_PIX_FMT_NV12M, pixels, 2}};
    case PixelFormat::kYuyv: return {{V4L2_PIX_FMT_YUYV, pixels, 1}};
    case PixelFormat::kUyvy: return {{V4L2_PIX_FMT_UYVY, pixels, 1}};
    case PixelFormat::kRgb24: return {{V4L2_PIX_FMT_RGB24, pixels, 1}};
    case PixelFormat::kGrey8: return {{V4L2_PIX_FMT_GREY, pixels, 1}};
    case PixelFormat::kI422: return {{V4L2_PIX_FMT_YUV422P, pixels, 1}, {V4L2_PIX_FMT_YUV422M, pixels, 3}};
    case PixelFormat::kMjpeg: return {{V4L2_PIX_FMT_MJPEG, pixels, 1}, {V4L2_PIX_FMT_JPEG, pixels, 1}};
    case PixelFormat::kRggb8: return {{V4L2_PIX_FMT_SRGGB8, pixels, 1}};
    case PixelFormat::kGrbg8: return {{V4L2_PIX_FMT_SGRBG8, pixels, 1}};
    case PixelFormat::kGbrg8: return {{V4L2_PIX_FMT_SGBRG8, pixels, 1}};
    case PixelFormat::kBggr8: return {{V4L2_PIX_FMT_SBGGR8, pixels, 1}};
    case PixelFormat::kYuv411:  // V4L2's packed 4:1:1, Y41P, has another order of bytes
    case PixelFormat::kGrey16:
    case PixelFormat::kRgb48: break;
  }
  return {};
}

std::string fourcc_text(std::uint32_t code) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) {
    const char c = static_cast<char>((code >> shift) & 0x7F);
    text += c > ' ' && c < 0x7F ? c : '?';
  }
  return text;
}

Result<Layout> make_layout(const FourCc& format, int width, int height, std::span<const std::uint32_t> strides) {
  const std::string what = fmt::format("{} of {}x{}", fourcc_text(format.code), width, height);
  if (width < 1 || height < 1 || width > kLargestSide || height > kLargestSide) {
    return fail(Errc::kDeviceFailed, "the driver offers " + what + ", which is not a valid size; choose another size");
  }
  NODAL_ASSERT(strides.size() >= static_cast<std::size_t>(format.memory_planes));
  Layout layout;
  layout.pixels = format.pixels;
  layout.width = width;
  layout.height = height;
  layout.memory_planes = format.memory_planes;

  const auto stride = [&](int plane) { return static_cast<std::size_t>(strides[static_cast<std::size_t>(plane)]); };
  const int half_w = (width + 1) / 2;
  const int half_h = (height + 1) / 2;
  const std::size_t luma = stride(0) * static_cast<std::size_t>(height);
  const auto row = [](std::size_t bytes) { return static_cast<std::ptrdiff_t>(bytes); };
  auto& parts = layout.components;
  // Chroma in the same buffer follows directly after the luma rows; planar chroma has half their stride.
  switch (format.pixels) {
    case PixelFormat::kMjpeg: layout.needed[0] = 1; return layout;  // a JPEG has no rows, and any length
    case PixelFormat::kGrey8:
    case PixelFormat::kRggb8:
    case PixelFormat::kGrbg8:
    case PixelFormat::kGbrg8:
    case PixelFormat::kBggr8: parts[0] = {0, 0, width, height, row(stride(0)), 1}; break;
    case PixelFormat::kI420:
    case PixelFormat::kI422: {
      const int rows = format.pixels == PixelFormat::kI420 ? half_h : height;
      parts[0] = {0, 0, width, height, row(stride(0)), 1};
      if (format.memory_planes == 3) {
        parts[1] = {1, 0, half_w, rows, row(stride(1)), 1};
        parts[2] = {2, 0, half_w, rows, row(stride(2)), 1};
      } else {
        const std::size_t half = stride(0) / 2;
        parts[1] = {0, luma, half_w, rows, row(half), 1};
        parts[2] = {0, luma + half * static_cast<std::size_t>(rows), half_w, rows, row(half), 1};
      }
      break;
    }
    case PixelFormat::kNv12: {
      const int plane = format.memory_planes == 2 ? 1 : 0;
      const std::size_t start = plane == 1 ? 0 : luma;
      parts[0] = {0, 0, width, height, row(stride(0)), 1};
      parts[1] = {plane, start, half_w, half_h, row(stride(plane)), 2};
      parts[2] = {plane, start + 1, half_w, half_h, row(stride(plane)), 2};
      break;
    }
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy: {
      const std::size_t first = format.pixels == PixelFormat::kYuyv ? 0 : 1;
      parts[0] = {0, first, width, height, row(stride(0)), 2};
      parts[1] = {0, 1 - first, half_w, height, row(stride(0)), 4};
      parts[2] = {0, 3 - first, half_w, height, row(stride(0)), 4};
      break;
    }
    case PixelFormat::kRgb24:
      for (std::size_t c = 0; c < 3; ++c) parts[c] = {0, c, width, height, row(stride(0)), 3};
      break;
    case PixelFormat::kYuv411:
    case PixelFormat::kGrey16:
    case PixelFormat::kRgb48: return fail(Errc::kUnsupported, "heads do not deliver " + what);
  }
  for (int c = 0; c < component_count(format.pixels); ++c) {
    const Layout::Component& part = parts[static_cast<std::size_t>(c)];
    const std::size_t in_row = static_cast<std::size_t>((part.width - 1) * part.pixel_stride) + 1;
    if (static_cast<std::size_t>(part.row_stride) < in_row ||
        static_cast<std::size_t>(part.row_stride) > kLargestStride) {
      return fail(
          Errc::kDeviceFailed,
          fmt::format("the driver offers {} with rows of {} bytes, in which they do not fit", what, part.row_stride));
    }
    std::size_t& needed = layout.needed[static_cast<std::size_t>(part.memory_plane)];
    const std::size_t end =
        part.offset + static_cast<std::size_t>(part.row_stride) * static_cast<std::size_t>(part.height - 1) + in_row;
    needed = std::max(needed, end);
  }
  return layout;
}

ImageView view_of(const Layout& layout, std::span<const std::uint8_t* const> planes, std::size_t used) {
  ImageView view{layout.pixels, layout.width, layout.height, {}, 0};
  if (layout.pixels == PixelFormat::kMjpeg) {
    view.planes[0] = {planes[0], static_cast<int>(used), 1, static_cast<std::ptrdiff_t>(used), 1};
    view.bytes = used;
    return view;
  }
  for (int c = 0; c < component_count(layout.pixels); ++c) {
    const Layout::Component& part = layout.components[static_cast<std::size_t>(c)];
    view.planes[static_cast<std::size_t>(c)] = {planes[static_cast<std::size_t>(part.memory_plane)] + part.offset,
                                                part.width, part.height, part.row_stride, part.pixel_stride};
  }
  for (const std::size_t needed : layout.needed) view.bytes += needed;
  return view;
}

}  // namespace nodal::hal::v4l2
