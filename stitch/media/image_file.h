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

class PictureBytes;

inline constexpr std::uint64_t kMaxImageFileBytes = std::uint64_t{256} << 20;
inline constexpr int kMaxImageSide = 32768;
/// Limit of decoded bytes per byte of file. Deflate expands at most 1032 times (zlib's technical details), baseline
/// JPEG 512 times per component. A larger claim is refused before memory is allocated; small pictures always pass.
inline constexpr std::uint64_t kMaxExpansion = 3096;
inline constexpr std::uint64_t kSmallImageBytes = std::uint64_t{1} << 20;

/// Decodes a JPEG or PNG, recognized by its first bytes. Without `as`, a 4:2:0 JPEG gives I420, a grey picture GREY,
/// everything else RGB24 (alpha is dropped, 16 bits are rounded to 8). `as` selects another format; kMjpeg gives the
/// bytes of a JPEG as they are, and RGB48 or GREY16 are only for files whose header has it as `deep`. YUV is full-range
/// BT.601, as in JPEG.
///
/// Threading: thread-safe.
/// Errors: each names the picture: kBadFormat when it is neither kind or is broken, kTruncated when it ends early (even
///   if a part could be decoded), kTooLarge, kUnsupported.
Result<DecodedImage> decode_image(std::span<const std::uint8_t> bytes, const std::string& name,
                                  std::optional<PixelFormat> as = std::nullopt);

/// The same for a file; additional errors: kNotFound and kIo.
Result<DecodedImage> read_image(const std::filesystem::path& file, std::optional<PixelFormat> as = std::nullopt);

/// Reads the header of a file, without decoding the picture.
Result<ImageHeader> read_image_header(const std::filesystem::path& file);

/// The same for a file that is open.
Result<DecodedImage> decode_image(PictureBytes& file, std::optional<PixelFormat> as = std::nullopt);
Result<ImageHeader> image_header(PictureBytes& file);

/// How opaque the pixels of a JPEG or PNG are, GREY of its size: 255 everywhere if it has no alpha channel.
/// Errors: those of decode_image().
Result<DecodedImage> decode_opacity(PictureBytes& file);

/// Converts a picture to another format (neither may be kMjpeg, Bayer or of 16 bits): RGB and YUV by full-range BT.601;
/// chroma is interpolated or averaged when its resolution changes. Slow: for opening files, not for the frame path.
DecodedImage convert_image(const ImageView& image, PixelFormat to);

}  // namespace nodal::media
