// The calibration's picture type: one plane of floats.
#pragma once

#include <cstddef>
#include <vector>

namespace nodal::calibration {

/// Values are 0..1. Sample (i, j) is the value at point (i + 1/2, j + 1/2).
struct GreyImage {
  int width = 0;
  int height = 0;
  std::vector<float> values;

  GreyImage() = default;
  GreyImage(int w, int h) : width(w), height(h), values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}

  float* row(int j) { return values.data() + static_cast<std::size_t>(j) * static_cast<std::size_t>(width); }
  const float* row(int j) const {
    return values.data() + static_cast<std::size_t>(j) * static_cast<std::size_t>(width);
  }
};

}  // namespace nodal::calibration
