// Pictures as TIFF files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/result.h"

namespace nodal::media {

/// Metadata of the file.
struct TiffNotes {
  std::string description;           ///< text for people who find the file later
  std::string xmp;                   ///< an XMP packet
  std::vector<std::uint8_t> icc{};   ///< an ICC profile; empty: none
  std::vector<std::uint8_t> exif{};  ///< FileMetadata::exif; empty: none
};

/// `picture`: packed, without padding; GREY, RGB24, GREY16 or RGB48. Deflate with horizontal differences.
/// Errors: kUnsupported for other formats; kTooLarge for more than 4 GB, which TIFF cannot hold; kInternal.
Result<std::vector<std::uint8_t>> tiff_file(const ImageView& picture, const TiffNotes& notes);

}  // namespace nodal::media
