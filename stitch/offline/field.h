// A picture of floating-point numbers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace nodal::offline {

/// Threading: a value.
struct Field {
  int width = 0, height = 0;
  std::vector<float> v;  ///< row by row
  Field() = default;
  Field(int w, int h) : width(w), height(h), v(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
  float* row(int y) { return v.data() + static_cast<std::ptrdiff_t>(y) * width; }
  const float* row(int y) const { return v.data() + static_cast<std::ptrdiff_t>(y) * width; }
};

/// A position between pixel centres.
struct Place {
  std::ptrdiff_t at;
  std::ptrdiff_t right, below;
  float across, down;
};

/// (0, 0) is the first pixel's centre; beyond the edges, the nearest position on an edge.
inline Place place_of(int width, int height, float x, float y) {
  x = std::clamp(x, 0.0F, static_cast<float>(width - 1));
  y = std::clamp(y, 0.0F, static_cast<float>(height - 1));
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  return {static_cast<std::ptrdiff_t>(j) * width + i, i + 1 < width ? 1 : 0, j + 1 < height ? width : 0,
          x - static_cast<float>(i), y - static_cast<float>(j)};
}

/// Bilinear.
inline float sample(const std::vector<float>& field, const Place& p) {
  const float* at = field.data() + p.at;
  const float top = at[0] + p.across * (at[p.right] - at[0]);
  const float bottom = at[p.below] + p.across * (at[p.below + p.right] - at[p.below]);
  return top + p.down * (bottom - top);
}
inline float sample(const Field& field, const Place& p) { return sample(field.v, p); }

}  // namespace nodal::offline
