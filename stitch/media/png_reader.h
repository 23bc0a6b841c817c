// PNG by libpng. Used by image_file.cpp only.
#pragma once

#include "stitch/media/image_file.h"

namespace nodal::media {

Result<ImageHeader> png_header(std::span<const std::uint8_t> bytes, const std::string& name);
/// `deep`: in the header's deep format, which it must have.
Result<DecodedImage> decode_png(std::span<const std::uint8_t> bytes, const std::string& name, bool deep);
/// How opaque the pixels are, GREY.
Result<DecodedImage> decode_png_opacity(std::span<const std::uint8_t> bytes, const std::string& name);

}  // namespace nodal::media
