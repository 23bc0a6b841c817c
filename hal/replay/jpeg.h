// JPEG by libjpeg-turbo. Used by image_file.cpp only.
#pragma once

#include "hal/replay/image_file.h"

namespace nodal::hal::replay {

Result<ImageHeader> jpeg_header(std::span<const std::uint8_t> bytes, const std::string& name);
Result<DecodedImage> decode_jpeg(std::span<const std::uint8_t> bytes, const std::string& name);

}  // namespace nodal::hal::replay
