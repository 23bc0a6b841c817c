// A picture decoded from a file: its header data and its pixels.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/base/image.h"

namespace nodal {

/// A packed picture that owns its bytes; as MJPEG, those of a JPEG file.
struct DecodedImage {
  PixelFormat format = PixelFormat::kRgb24;
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> bytes;

  ImageView view() const {
    if (format != PixelFormat::kMjpeg) return packed_image(format, width, height, bytes.data());
    ImageView jpeg{format, width, height, {}, bytes.size()};
    const int length = static_cast<int>(bytes.size());
    jpeg.planes[0] = {bytes.data(), length, 1, length, 1};
    return jpeg;
  }
};

/// The data of a file's header, read without decoding the picture.
struct ImageHeader {
  int width = 0;
  int height = 0;
  PixelFormat natural = PixelFormat::kRgb24;  ///< the format that decoding gives if none is requested
  /// RGB48 or GREY16 if the file has 16 bits a sample: the format in which decoding gives them all on request.
  std::optional<PixelFormat> deep = std::nullopt;
};

}  // namespace nodal
