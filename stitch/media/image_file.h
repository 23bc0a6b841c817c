// Pictures from JPEG and PNG files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::media {

inline constexpr std::uint64_t kMaxImageFileBytes = std::uint64_t{256} << 20;
inline constexpr int kMaxImageSide = 32768;
/// Bytes of picture that a byte of file can hold: deflate gives 1032 for one (zlib's technical details), a baseline JPEG at
/// most 512 samples a component. A file that claims more is refused before memory is taken; small ones always pass.
inline constexpr std::uint64_t kMaxExpansion = 3096;
inline constexpr std::uint64_t kSmallImageBytes = std::uint64_t{1} << 20;

/// Decodes a JPEG or PNG, recognized by its first bytes. A 4:2:0 JPEG gives I420 as it was coded, a grey picture GREY,
/// anything else RGB24 (alpha is dropped, 16 bits are rounded to 8); `as` asks for another format (not kMjpeg).
/// Y U V are full range BT.601, as JPEG has them.
///
/// Threading: thread-safe.
/// Errors: each names the picture: kBadFormat when it is neither kind or broken, kTruncated when it ends early (a
///   picture of which a part could be had is an error too), kTooLarge, kUnsupported.
Result<DecodedImage> decode_image(std::span<const std::uint8_t> bytes, const std::string& name,
                                  std::optional<PixelFormat> as = std::nullopt);

/// The same of a file; also kNotFound and kIo.
Result<DecodedImage> read_image(const std::filesystem::path& file, std::optional<PixelFormat> as = std::nullopt);

/// The header of a file, without decoding the rest.
Result<ImageHeader> read_image_header(const std::filesystem::path& file);

/// A picture in another format (neither is kMjpeg): RGB and YUV by full-range BT.601; chroma is interpolated where
/// it is coarser and averaged where it becomes coarser. Not fast: for opening files, not for the frame path.
DecodedImage convert_image(const ImageView& image, PixelFormat to);

}  // namespace nodal::media
