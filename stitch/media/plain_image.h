// Pictures for programs without colour management: those that need none, and a refusal of all others.
#pragma once

#include <filesystem>
#include <optional>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::media {

/// Nothing if the numbers of a picture with this header are sRGB's, or if the file does not say what they are.
/// Errors: kUnsupported, with the picture's name and what to do, for a picture with another colour profile, with other
///   primaries or another curve, or in Adobe RGB by its Exif (Interoperability index R03, DCF 2.0, 3.3.3).
Status check_plain(const ImageHeader& header, const std::filesystem::path& file);

/// read_image_header() and read_image(), for such pictures only.
Result<ImageHeader> read_plain_header(const std::filesystem::path& file);
Result<DecodedImage> read_plain_image(const std::filesystem::path& file, std::optional<PixelFormat> as);

}  // namespace nodal::media
