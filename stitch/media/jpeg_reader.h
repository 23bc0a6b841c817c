// JPEG by libjpeg-turbo. Used by image_file.cpp only.
#pragma once

#include "stitch/media/image_file.h"

namespace nodal::media {

Result<ImageHeader> jpeg_header(std::span<const std::uint8_t> bytes, const std::string& name);
Result<DecodedImage> decode_jpeg(std::span<const std::uint8_t> bytes, const std::string& name);

}  // namespace nodal::media
