// HEIF by libheif. Used by reader.cpp only.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::media {

/// Whether the file begins with ISO's box of file types.
bool is_heif(std::span<const std::uint8_t> bytes);
Result<ImageHeader> heif_header(std::span<const std::uint8_t> bytes, const std::string& name);
Result<DecodedImage> decode_heif(std::span<const std::uint8_t> bytes, const ImageHeader& header,
                                 const std::string& name);
/// Pictures in the file that are no thumbnails, masks or parts of others; 0 if it is broken.
int count_heif_pictures(std::span<const std::uint8_t> bytes);
/// How opaque the pixels are, GREY.
Result<DecodedImage> decode_heif_opacity(std::span<const std::uint8_t> bytes, const ImageHeader& header,
                                         const std::string& name);

}  // namespace nodal::media
