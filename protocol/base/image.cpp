#include "protocol/base/image.h"

#include "protocol/base/result.h"

namespace nodal {

std::string_view pixel_format_name(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGrey8: return "GREY";
    case PixelFormat::kI420: return "I420";
    case PixelFormat::kNv12: return "NV12";
    case PixelFormat::kYuyv: return "YUYV";
    case PixelFormat::kUyvy: return "UYVY";
    case PixelFormat::kRgb24: return "RGB24";
    case PixelFormat::kMjpeg: return "MJPEG";
    case PixelFormat::kGrey16: return "GREY16";
    case PixelFormat::kRgb48: return "RGB48";
    case PixelFormat::kI422: return "I422";
    case PixelFormat::kRggb8: return "RGGB8";
    case PixelFormat::kGrbg8: return "GRBG8";
    case PixelFormat::kGbrg8: return "GBRG8";
    case PixelFormat::kBggr8: return "BGGR8";
    case PixelFormat::kYuv411: return "YUV411";
  }
  return "unknown";
}

std::optional<PixelFormat> pixel_format_named(std::string_view name) {
  for (auto i = static_cast<int>(PixelFormat::kGrey8); i <= static_cast<int>(PixelFormat::kYuv411); ++i) {
    const auto format = static_cast<PixelFormat>(i);
    if (pixel_format_name(format) == name) return format;
  }
  return std::nullopt;
}

bool has_chroma(PixelFormat format) {
  return format == PixelFormat::kI420 || format == PixelFormat::kNv12 || format == PixelFormat::kYuyv ||
         format == PixelFormat::kUyvy || format == PixelFormat::kI422 || format == PixelFormat::kYuv411;
}

bool is_bayer(PixelFormat format) {
  return format == PixelFormat::kRggb8 || format == PixelFormat::kGrbg8 || format == PixelFormat::kGbrg8 ||
         format == PixelFormat::kBggr8;
}

bool is_raymap_format(PixelFormat format) {
  return format == PixelFormat::kI420 || format == PixelFormat::kNv12 || format == PixelFormat::kRgb24 ||
         format == PixelFormat::kGrey8 || format == PixelFormat::kRgb48 || format == PixelFormat::kGrey16;
}

std::optional<PixelFormat> blended_format(PixelFormat delivered, PixelFormat raymap) {
  if (delivered == PixelFormat::kMjpeg || is_bayer(delivered)) {
    return has_chroma(raymap) ? PixelFormat::kI420 : in_8_bits(raymap);
  }
  if (delivered == PixelFormat::kYuv411) return has_chroma(raymap) ? std::optional(PixelFormat::kI422) : std::nullopt;
  const bool fits = has_chroma(raymap) ? has_chroma(delivered) : delivered == in_8_bits(raymap);
  return fits ? std::optional(delivered) : std::nullopt;
}

bool is_linear16(PixelFormat format) { return format == PixelFormat::kGrey16 || format == PixelFormat::kRgb48; }

PixelFormat in_8_bits(PixelFormat format) {
  if (format == PixelFormat::kGrey16) return PixelFormat::kGrey8;
  return format == PixelFormat::kRgb48 ? PixelFormat::kRgb24 : format;
}

int component_count(PixelFormat format) {
  const bool grey = format == PixelFormat::kGrey8 || format == PixelFormat::kGrey16;
  return grey || is_bayer(format) || format == PixelFormat::kMjpeg || format == PixelFormat::kYuv411 ? 1 : 3;
}

PlaneGrid component_grid(PixelFormat format, int c) {
  NODAL_ASSERT(c >= 0 && c < component_count(format));
  if (c == 0) return {};
  switch (format) {
    case PixelFormat::kI420:
    case PixelFormat::kNv12: return {2, 2, 0.0, 0.0};
    // Chroma sample k is at luma sample 2k, whose centre is at 2k + 1/2: u_plane = u / 2 + 1/4.
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy:
    case PixelFormat::kI422: return {2, 1, 0.25, 0.0};
    default: return {};
  }
}

namespace {

bool has_all_chroma_rows(PixelFormat format) {
  return format == PixelFormat::kYuyv || format == PixelFormat::kUyvy || format == PixelFormat::kI422;
}

}  // namespace

ImageView halved_chroma(ImageView picture) {
  if (!has_all_chroma_rows(picture.format)) return picture;
  for (std::size_t c = 1; c < kMaxPlanes; ++c) {
    picture.planes[c].row_stride *= 2;
    picture.planes[c].height = (picture.planes[c].height + 1) / 2;
  }
  return picture;
}

PlaneGrid halved_chroma_grid(PixelFormat format, int c, PlaneGrid all_rows) {
  if (c == 0 || !has_all_chroma_rows(format)) return all_rows;
  // Row k of the result is row 2 k, with its centre at 2 k + 1/2 in all rows: halved = all / 2 + 1/4.
  return {all_rows.step_x, 2 * all_rows.step_y, all_rows.offset_x, all_rows.offset_y / 2 + 0.25};
}

std::size_t packed_size(PixelFormat format, int width, int height) {
  const auto w = static_cast<std::size_t>(width);
  const auto h = static_cast<std::size_t>(height);
  const std::size_t half_w = (w + 1) / 2;
  const std::size_t half_h = (h + 1) / 2;
  switch (format) {
    case PixelFormat::kGrey8:
    case PixelFormat::kRggb8:
    case PixelFormat::kGrbg8:
    case PixelFormat::kGbrg8:
    case PixelFormat::kBggr8: return w * h;
    case PixelFormat::kI420:
    case PixelFormat::kNv12: return w * h + 2 * half_w * half_h;
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy: return 4 * half_w * h;
    case PixelFormat::kI422: return w * h + 2 * half_w * h;
    case PixelFormat::kRgb24: return 3 * w * h;
    case PixelFormat::kGrey16: return 2 * w * h;
    case PixelFormat::kRgb48: return 6 * w * h;
    case PixelFormat::kYuv411: return static_cast<std::size_t>(yuv411_row_bytes(width)) * h;
    case PixelFormat::kMjpeg: return 0;
  }
  return 0;
}

namespace {

template <class Byte>
BasicImageView<Byte> packed(PixelFormat format, int width, int height, Byte* data) {
  NODAL_ASSERT(format != PixelFormat::kMjpeg);
  BasicImageView<Byte> image{format, width, height, {}, packed_size(format, width, height)};
  const std::ptrdiff_t w = width;
  const std::ptrdiff_t h = height;
  const int half_w = (width + 1) / 2;
  const int half_h = (height + 1) / 2;
  const auto after = [data](std::ptrdiff_t bytes) {
    return data == nullptr ? nullptr : data + bytes;
  };  // shape only, no memory
  switch (format) {
    case PixelFormat::kGrey8:
    case PixelFormat::kRggb8:
    case PixelFormat::kGrbg8:
    case PixelFormat::kGbrg8:
    case PixelFormat::kBggr8: image.planes[0] = {data, width, height, w, 1}; break;
    case PixelFormat::kI420:
      image.planes = {{{data, width, height, w, 1},
                       {after(w * h), half_w, half_h, half_w, 1},
                       {after(w * h + std::ptrdiff_t{half_w} * half_h), half_w, half_h, half_w, 1}}};
      break;
    case PixelFormat::kNv12: {
      const std::ptrdiff_t stride = 2 * std::ptrdiff_t{half_w};
      image.planes = {{{data, width, height, w, 1},
                       {after(w * h), half_w, half_h, stride, 2},
                       {after(w * h + 1), half_w, half_h, stride, 2}}};
      break;
    }
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy: {
      const std::ptrdiff_t stride = 4 * std::ptrdiff_t{half_w};
      const int luma = format == PixelFormat::kYuyv ? 0 : 1;
      image.planes = {{{after(luma), width, height, stride, 2},
                       {after(1 - luma), half_w, height, stride, 4},
                       {after(3 - luma), half_w, height, stride, 4}}};
      break;
    }
    case PixelFormat::kI422:
      image.planes = {{{data, width, height, w, 1},
                       {after(w * h), half_w, height, half_w, 1},
                       {after(w * h + half_w * h), half_w, height, half_w, 1}}};
      break;
    case PixelFormat::kRgb24:
    case PixelFormat::kRgb48: {
      const int sample = format == PixelFormat::kRgb48 ? 2 : 1;
      for (int c = 0; c < 3; ++c) {
        image.planes[static_cast<std::size_t>(c)] = {after(c * sample), width, height, 3 * sample * w, 3 * sample};
      }
      break;
    }
    case PixelFormat::kGrey16: image.planes[0] = {data, width, height, 2 * w, 2}; break;
    case PixelFormat::kYuv411:
      image.planes[0] = {data, yuv411_row_bytes(width), height, yuv411_row_bytes(width), 1};
      break;
    case PixelFormat::kMjpeg: break;
  }
  return image;
}

}  // namespace

ImageView packed_image(PixelFormat format, int width, int height, const std::uint8_t* data) {
  return packed(format, width, height, data);
}
MutableImageView packed_image(PixelFormat format, int width, int height, std::uint8_t* data) {
  return packed(format, width, height, data);
}

}  // namespace nodal
