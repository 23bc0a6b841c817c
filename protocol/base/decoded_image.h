// A picture out of a file: what its header says, and its pixels.
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

/// What a file's header says, without decoding the rest.
struct ImageHeader {
  int width = 0;
  int height = 0;
  PixelFormat natural = PixelFormat::kRgb24;  ///< what decoding gives when no format is asked for
};

}  // namespace nodal
