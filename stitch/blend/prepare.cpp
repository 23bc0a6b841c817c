#include "stitch/blend/prepare.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "stitch/blend/clones.h"
#include "stitch/blend/low_picture.h"

namespace nodal::blend {
namespace {

constexpr int kOne = 1 << kSharpenBits;

/// All steps fit 16 bits: (64 + 4 * 16) * 255 + 32 < 2^15.
[[gnu::always_inline]] inline std::uint8_t sharper(std::int16_t own, std::int16_t around, std::int16_t own_share,
                                                   std::int16_t sharpen) {
  const auto sum = static_cast<std::int16_t>(own * own_share - around * sharpen + kOne / 2);
  return static_cast<std::uint8_t>(std::clamp<std::int16_t>(static_cast<std::int16_t>(sum >> kSharpenBits), 0, 255));
}

/// The inner samples of a row; kStride is the pixel stride.
template <int kStride>
[[gnu::always_inline]] inline void sharpen_inside(const std::uint8_t* own, const std::uint8_t* above,
                                                  const std::uint8_t* below, std::uint8_t* out, int width,
                                                  std::int16_t sharpen) {
  const auto own_share = static_cast<std::int16_t>(kOne + 4 * sharpen);
  constexpr int kReach = kSharpenReach * kStride;
  for (int x = kSharpenReach; x < width - kSharpenReach; ++x) {
    const int at = x * kStride;
    const auto around = static_cast<std::int16_t>(own[at - kReach] + own[at + kReach] + above[at] + below[at]);
    out[x] = sharper(own[at], around, own_share, sharpen);
  }
}

NODAL_CLONES void sharpen_plane(const PlaneView& in, std::uint8_t* to, std::ptrdiff_t stride, std::int16_t sharpen) {
  const int last = in.width - 1;
  for (int y = 0; y < in.height; ++y, to += stride) {
    const std::uint8_t* own = in.data + y * in.row_stride;
    const std::uint8_t* above = in.data + std::max(y - kSharpenReach, 0) * in.row_stride;
    const std::uint8_t* below = in.data + std::min(y + kSharpenReach, in.height - 1) * in.row_stride;
    const auto anywhere = [&](int x) {
      const int s = in.pixel_stride, left = std::max(x - kSharpenReach, 0), right = std::min(x + kSharpenReach, last);
      const auto around = static_cast<std::int16_t>(own[left * s] + own[right * s] + above[x * s] + below[x * s]);
      to[x] = sharper(own[x * s], around, static_cast<std::int16_t>(kOne + 4 * sharpen), sharpen);
    };
    for (int x = 0; x < std::min(kSharpenReach, in.width); ++x) {
      anywhere(x);
      anywhere(last - x);
    }
    switch (in.pixel_stride) {
      case 1: sharpen_inside<1>(own, above, below, to, in.width, sharpen); break;
      case 2: sharpen_inside<2>(own, above, below, to, in.width, sharpen); break;
      case 3: sharpen_inside<3>(own, above, below, to, in.width, sharpen); break;
      case 4: sharpen_inside<4>(own, above, below, to, in.width, sharpen); break;
      default:
        for (int x = kSharpenReach; x < in.width - kSharpenReach; ++x) anywhere(x);
    }
  }
}

/// The sum of samples 2 x and 2 x + 1. If contiguous, they are read as one 16-bit number; their order does not matter.
template <int kStride>
[[gnu::always_inline]] inline std::uint16_t pair_at(const std::uint8_t* row, int x) {
  if constexpr (kStride == 1) {
    std::uint16_t pair;
    std::memcpy(&pair, row + 2 * x, 2);
    return static_cast<std::uint16_t>((pair & 255) + (pair >> 8));
  }
  const std::uint8_t* at = row + 2 * x * kStride;
  return static_cast<std::uint16_t>(at[0] + at[kStride]);
}

/// Reads one row completely, then the other: memory delivers bytes in address order twice as fast as from two rows
/// alternately.
template <int kStride>
[[gnu::always_inline]] inline void halve_row(const std::uint8_t* upper, const std::uint8_t* lower, std::uint8_t* to,
                                             int width) {
  std::array<std::uint16_t, 4096> sum;
  for (int begin = 0; begin < width; begin += static_cast<int>(sum.size())) {
    const int count = std::min(width - begin, static_cast<int>(sum.size()));
    for (int x = 0; x < count; ++x) sum[static_cast<std::size_t>(x)] = pair_at<kStride>(upper, begin + x);
    for (int x = 0; x < count; ++x) {
      const int four = sum[static_cast<std::size_t>(x)] + pair_at<kStride>(lower, begin + x) + 2;
      to[begin + x] = static_cast<std::uint8_t>(static_cast<std::uint16_t>(four) >> 2);
    }
  }
}

/// Makes rows [begin, end).
NODAL_CLONES void halve_rows(const PlaneView& in, std::uint8_t* plane, std::ptrdiff_t stride, int begin, int end) {
  const int width = in.width / 2;
  std::uint8_t* to = plane + begin * stride;
  for (int y = begin; y < end; ++y, to += stride) {
    const std::uint8_t* upper = in.data + 2 * y * in.row_stride;
    const std::uint8_t* lower = upper + in.row_stride;
    switch (in.pixel_stride) {
      case 1: halve_row<1>(upper, lower, to, width); break;
      case 2: halve_row<2>(upper, lower, to, width); break;
      case 3: halve_row<3>(upper, lower, to, width); break;
      case 4: halve_row<4>(upper, lower, to, width); break;
      default: {
        const std::ptrdiff_t s = in.pixel_stride;
        for (int x = 0; x < width; ++x) {
          const std::ptrdiff_t at = 2 * x * s;
          to[x] = static_cast<std::uint8_t>((upper[at] + upper[at + s] + lower[at] + lower[at + s] + 2) >> 2);
        }
      }
    }
  }
}

/// `made`: of BlendTable::Source.
void halve_plane(const PlaneView& in, std::uint8_t* to, std::ptrdiff_t stride, const std::vector<bool>& made) {
  const int height = in.height / 2;
  if (made.empty()) return halve_rows(in, to, stride, 0, height);
  for (std::size_t band = 0; band < made.size(); ++band) {
    const int begin = static_cast<int>(band) * kMadeRows;
    if (made[band]) halve_rows(in, to, stride, begin, std::min(height, begin + kMadeRows));
  }
}

/// Rows begin at a cache line, so that patch rows seldom span two lines.
constexpr std::size_t kLine = 64;
std::ptrdiff_t stride_of(const PlaneView& plane) {
  return static_cast<std::ptrdiff_t>((static_cast<std::size_t>(plane.width) + kLine - 1) / kLine * kLine);
}

std::size_t size_apart(const ImageView& shape) {
  std::size_t bytes = 0;
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(shape.format)); ++c) {
    bytes += static_cast<std::size_t>(stride_of(shape.planes[c]) * shape.planes[c].height);
  }
  return bytes;
}

/// The components of `shape`, each in its own plane, stored one after another from `memory` on.
ImageView apart(const ImageView& shape, std::uint8_t* memory) {
  ImageView image{shape.format, shape.width, shape.height, {}, size_apart(shape)};
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(shape.format)); ++c) {
    const PlaneView& plane = shape.planes[c];
    image.planes[c] = {memory, plane.width, plane.height, stride_of(plane), 1};
    memory += stride_of(plane) * plane.height;
  }
  return image;
}

ImageView half(ImageView shape) {
  shape.width /= 2;
  shape.height /= 2;
  for (PlaneView& plane : shape.planes) {
    plane.width /= 2;
    plane.height /= 2;
  }
  return shape;
}

/// A picture as prepare_picture reads it: YUYV, UYVY and I422 with only the chroma rows that the blend uses, hence as
/// I420.
ImageView as_read(ImageView picture) {
  picture = halved_chroma(picture);
  if (has_chroma(picture.format) && picture.format != PixelFormat::kNv12) picture.format = PixelFormat::kI420;
  return picture;
}

ImageView shape_of(const BlendTable::Source& source) {
  return as_read(packed_image(source.format, source.width, source.height, static_cast<const std::uint8_t*>(nullptr)));
}

}  // namespace

std::size_t prepared_size(const BlendTable::Source& source) {
  ImageView shape = shape_of(source);
  std::size_t bytes = source.sharpen == 0 ? 0 : size_apart(shape);
  for (int level = 1; level < source.levels; ++level) {
    shape = half(shape);
    bytes += size_apart(shape);
  }
  if (source.low_size != 0) bytes += low_picture(source, shape_of(source), nullptr).bytes;
  return bytes == 0 ? 0 : bytes + kLine;  // the memory may begin anywhere
}

void prepare_picture(const BlendTable::Source& source, const ImageView& picture, std::uint8_t* memory,
                     std::span<ImageView> views) {
  const auto components = static_cast<std::size_t>(component_count(source.format));
  memory += (kLine - reinterpret_cast<std::uintptr_t>(memory) % kLine) % kLine;
  views[0] = picture;
  const ImageView read = as_read(picture);
  if (source.sharpen != 0) {
    views[0] = apart(read, memory);
    for (std::size_t c = 0; c < components; ++c) {
      const std::ptrdiff_t stride = stride_of(read.planes[c]);
      sharpen_plane(read.planes[c], memory, stride, source.sharpen);
      memory += stride * read.planes[c].height;
    }
  }
  ImageView larger = read;
  for (std::size_t level = 1; level < source.levels; ++level) {
    views[level] = apart(half(larger), memory);
    for (std::size_t c = 0; c < components; ++c) {
      const std::ptrdiff_t stride = views[level].planes[c].row_stride;
      const std::size_t grid = has_chroma(source.format) && c > 0 ? 1 : 0;
      halve_plane(larger.planes[c], memory, stride, source.made[grid][level - 1]);
      memory += stride * views[level].planes[c].height;
    }
    larger = views[level];
  }
  if (source.low_size == 0) return;
  views[source.levels] = low_picture(source, read, memory);
  make_low_picture(source, read, memory);
}

}  // namespace nodal::blend
