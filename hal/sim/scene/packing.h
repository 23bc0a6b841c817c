// Converts rows of red, green and blue to a head's pixel format.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/base/image.h"

namespace nodal::hal::sim {

inline constexpr int kLevelBits = 7;  ///< rows hold levels 0 .. 255 in 1 / (1 << kLevelBits)

/// Two rows of a picture, columns from `x0` on: row[r][c][x - x0].
struct RowPair {
  std::array<std::array<const std::int16_t*, 3>, 2> row{};
  int x0 = 0;  ///< first column present
  int x1 = 0;  ///< one past the last
};

/// Writes rows y and y + 1 (y is even; the second is left out if it is past the picture), columns [x0, x1), x0 even.
/// The rows must include one more column on each side where the picture has one. Colours are converted to full-range
/// BT.601 before rounding; I420 and NV12 chroma averages 2x2 samples, YUYV, UYVY and I422 chroma is weighted
/// (1 2 1) / 4 around the even column, that of YUV411 around every fourth. Bayer formats keep one colour of each pixel.
void pack_rows(const RowPair& rows, int y, int x0, int x1, const MutableImageView& into);

}  // namespace nodal::hal::sim
