// A picture file with any bytes, for the targets png and jpeg.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "memory_limit.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "stitch/media/image_file.h"

namespace nodal::fuzz {

inline constexpr std::size_t kLongestPicture = 16U << 10;
/// The memory that decoding may use: three times the picture (image_file.h limits it by the file's length), for the
/// decoder's own coefficients and rows.
inline constexpr std::size_t kPictureMemory =
    3 * (media::kSmallImageBytes + media::kMaxExpansion * kLongestPicture) + (std::size_t{32} << 20);
/// Larger pictures are skipped: every scan of a progressive JPEG takes time for every pixel.
inline constexpr std::size_t kMaxPixels = 1U << 20;

/// Decodes it to its own and to another format. The result has the number of bytes that its size requires.
template <class Header>
void decode_any(std::span<const std::uint8_t> bytes, Header header) {
  static const bool limited = (limit_memory(kPictureMemory), true);
  (void)limited;
  if (bytes.size() > kLongestPicture) return;
  const auto size = header(bytes, "fuzz");
  if (size && static_cast<std::size_t>(size->width) * static_cast<std::size_t>(size->height) > kMaxPixels) {
    // Here it only matters whether it is refused, or would be decoded within its memory.
    const std::uint64_t decoded = packed_size(size->natural, size->width, size->height);
    if (decoded <= media::kSmallImageBytes + media::kMaxExpansion * bytes.size()) return;
    NODAL_ASSERT(!media::decode_image(bytes, "fuzz").has_value());
    return;
  }
  const auto image = media::decode_image(bytes, "fuzz");
  if (!image) return;
  NODAL_ASSERT(image->width > 0 && image->height > 0);
  NODAL_ASSERT(image->bytes.size() == packed_size(image->format, image->width, image->height));
  const auto rgb = media::decode_image(bytes, "fuzz", PixelFormat::kRgb24);
  NODAL_ASSERT(rgb.has_value() && rgb->bytes.size() == packed_size(PixelFormat::kRgb24, image->width, image->height));
}

}  // namespace nodal::fuzz
