// A picture decoded from a file: its header data and its pixels.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/base/image.h"

namespace nodal {

/// A packed picture that owns its bytes.
struct DecodedImage {
  PixelFormat format = PixelFormat::kRgb24;
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> bytes;

  ImageView view() const { return packed_image(format, width, height, bytes.data()); }
};

/// The data of a file's header, read without decoding the picture.
struct ImageHeader {
  int width = 0;
  int height = 0;
  PixelFormat natural = PixelFormat::kRgb24;  ///< the format that decoding gives if none is requested
};

}  // namespace nodal
