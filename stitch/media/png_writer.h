// Pictures as PNG files.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::media {

/// Rows packed, channels interleaved.
struct PngPicture {
  int width = 0;
  int height = 0;
  int channels = 1;  ///< 1: grey, 3: red, green, blue
  int bits = 8;      ///< 8, or 16 with the lower byte first
  std::span<const std::uint8_t> samples;
};

/// Metadata of the file.
struct PngNotes {
  SampleMeaning meaning{};           ///< its curve, as sRGB or gAMA; Curve::kUnsaid: not recorded
  int pixels_per_meter = 0;          ///< resolution for printers; 0: not recorded
  std::string comment{};             ///< text for people who find the file later
  std::string xmp{};                 ///< an XMP packet
  int effort = 6;                    ///< zlib's compression level, 1 .. 9
  std::vector<std::uint8_t> exif{};  ///< FileMetadata::exif
};

/// Errors: kInternal.
Result<std::vector<std::uint8_t>> png_file(const PngPicture& picture, const PngNotes& notes);

}  // namespace nodal::media
