// Polygons around the hidden pixels of a mask that was drawn as a picture.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::geometry {

/// A picture's pixels, row by row: 1 where the pixel is not used, else 0.
struct HiddenPixels {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> values;

  bool at(int x, int y) const {
    return values[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)] != 0;
  }
  void hide(int x, int y) {
    values[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)] = 1;
  }
};

struct MaskOutline {
  std::vector<std::vector<Region::Point>> polygons;
  double more_px = 0;  ///< the polygons cover all hidden pixels, and at most about this much around them
};

/// The polygons that cover the hidden pixels and their neighbours, from which values between pixels are interpolated;
/// as many as a calibration may have: exactly their outlines if these have few corners, else larger and simpler ones. A
/// part that surrounds visible pixels is one polygon, whose outer and inner outlines are connected by an edge there and
/// back.
/// Errors: kTooLarge when the mask is so ragged that the polygons would cover much more than its pixels.
Result<MaskOutline> outline_of(const HiddenPixels& hidden);

}  // namespace nodal::geometry
