// Rows of red, green and blue into a head's pixel format.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/base/image.h"

namespace nodal::hal::sim {

inline constexpr int kLevelBits = 7;  ///< rows hold levels of 255 in 1 / (1 << kLevelBits)

/// Two rows of a picture, columns from `x0` on: row[r][c][x - x0].
struct RowPair {
  std::array<std::array<const std::int16_t*, 3>, 2> row{};
  int x0 = 0;  ///< first column that is there
  int x1 = 0;  ///< behind the last
};

/// Writes rows y and y + 1 (y is even; the second may be past the picture and is then left out), columns
/// [x0, x1), x0 even. The rows must reach one column further to each side, where the picture does.
/// Colour is turned to full-range BT.601 before it is rounded; I420 and NV12 average two by two, YUYV and UYVY take
/// (1 2 1) / 4 about the even column.
void pack_rows(const RowPair& rows, int y, int x0, int x1, const MutableImageView& into);

}  // namespace nodal::hal::sim
