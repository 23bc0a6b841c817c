// Pictures from TIFF files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::media {

class PictureBytes;

inline constexpr std::uint64_t kMaxTiffFileBytes = std::uint64_t{2} << 30;

/// Whether the file begins as a TIFF or BigTIFF of either byte order, and is not a camera's raw file, whose first
/// picture is a thumbnail.
bool is_tiff(const std::filesystem::path& file);

/// The first picture of a TIFF: strips or tiles, interleaved or by plane, 1 to 16 bits, grey, palette, RGB, YCbCr and
/// CMYK, in every compression that libtiff knows. Grey pictures give GREY, all others RGB24. 16 bits are rounded to 8,
/// except with `as`: the format that the header has as `deep`, which grey and RGB of 16 bits have. Colours that
/// the file has multiplied by alpha (ExtraSamples) are divided by it; alpha itself is left out. Rows are as the file
/// stores them, whatever its orientation says.
///
/// Threading: thread-safe.
/// Errors: each names the picture: kNotFound, kIo, kBadFormat when it is no TIFF or is broken, kTruncated when the file
///   is too short for the picture, kTooLarge, kUnsupported for samples of other kinds (such as floating point).
Result<DecodedImage> read_tiff(const std::filesystem::path& file, std::optional<PixelFormat> as = std::nullopt);

/// Its size and format, without decoding it. Errors: as read_tiff(), except those of its pixels.
Result<ImageHeader> read_tiff_header(const std::filesystem::path& file);

/// The same for a file that is open. decode_tiff() takes the bytes out of it.
bool is_tiff(PictureBytes& file);
Result<DecodedImage> decode_tiff(PictureBytes& file, std::optional<PixelFormat> as = std::nullopt);
Result<ImageHeader> tiff_header(const PictureBytes& file);

/// How opaque the pixels are, GREY: 255 everywhere if the file has no alpha channel of 8 or 16 bits.
/// Errors: those of decode_tiff().
Result<DecodedImage> decode_tiff_opacity(PictureBytes& file);

}  // namespace nodal::media
