// WebP by libwebp. Used by reader.cpp only.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::media {

bool is_webp(std::span<const std::uint8_t> bytes);
Result<ImageHeader> webp_header(std::span<const std::uint8_t> bytes, const std::string& name);
Result<DecodedImage> decode_webp(std::span<const std::uint8_t> bytes, const ImageHeader& header,
                                 const std::string& name);
/// How opaque the pixels are, GREY.
Result<DecodedImage> decode_webp_opacity(std::span<const std::uint8_t> bytes, const ImageHeader& header,
                                         const std::string& name);

}  // namespace nodal::media
