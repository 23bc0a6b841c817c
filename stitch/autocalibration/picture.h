// A grey picture of floats, and pictures reduced to a size that suits the work.
#pragma once

#include <cstddef>
#include <vector>

#include "protocol/base/decoded_image.h"

namespace nodal::autocalibration {

/// A grey picture; sample (i, j) is the value at point (i + 1/2, j + 1/2).
struct Picture {
  int width = 0;
  int height = 0;
  std::vector<float> values;  ///< 0..255, row by row

  float at(int x, int y) const {
    return values[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  }
};

/// A grey picture (kGrey8) reduced by the smallest whole number with which its longer side is at most `side`.
Picture reduced(const DecodedImage& picture, int side);

/// The longest side of pictures for image circles and edges, px.
inline constexpr int kEdgeSide = 800;

}  // namespace nodal::autocalibration
