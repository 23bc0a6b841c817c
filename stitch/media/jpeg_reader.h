// JPEG by libjpeg-turbo. Used by image_file.cpp and thumbnail.cpp only.
#pragma once

#include "stitch/media/image_file.h"

namespace nodal::media {

Result<ImageHeader> jpeg_header(std::span<const std::uint8_t> bytes, const std::string& name);
/// In the natural format of jpeg_header(); with `rgb`, RGB24 in place of I420, with chroma interpolated.
Result<DecodedImage> decode_jpeg(std::span<const std::uint8_t> bytes, const std::string& name, bool rgb);
/// Grey or RGB24, an eighth as wide and high, rounded up.
Result<DecodedImage> decode_jpeg_eighth(std::span<const std::uint8_t> bytes, const std::string& name);

}  // namespace nodal::media
