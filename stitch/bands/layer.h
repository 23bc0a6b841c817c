// A part of an equirectangular picture in floating point.
#pragma once

#include <cstddef>
#include <vector>

namespace nodal::bands {

/// The pixels of a whole sphere: row 0 is at the upper pole, column 0 at -180 degrees; sides may have any length.
struct Grid {
  int width = 0;
  int height = 0;
  friend bool operator==(const Grid&, const Grid&) = default;
};

/// A rectangle of a grid; columns continue at 0 after the last one.
struct Window {
  int x = 0;  ///< 0 .. grid width - 1
  int y = 0;
  int width = 0;  ///< up to the grid's
  int height = 0;
  static Window all(Grid grid) { return {0, 0, grid.width, grid.height}; }
};

/// The pixels of a window, `channels` numbers each.
///
/// Threading: a value.
class Layer {
 public:
  Layer() = default;
  Layer(Grid grid, Window window, int channels)
      : grid_(grid),
        window_(window),
        channels_(channels),
        data_(static_cast<std::size_t>(window.width) * static_cast<std::size_t>(window.height) *
              static_cast<std::size_t>(channels)) {}

  Grid grid() const { return grid_; }
  const Window& window() const { return window_; }
  int channels() const { return channels_; }
  /// Whether rows are whole circles.
  bool closed() const { return window_.width == grid_.width; }

  /// The pixel in column i and row j of the window.
  float* at(int i, int j) { return data_.data() + index(i, j); }
  const float* at(int i, int j) const { return data_.data() + index(i, j); }
  /// The pixel in column x and row y of the grid; null outside the window. 0 <= x < grid width.
  const float* find(int x, int y) const {
    const int i = x >= window_.x ? x - window_.x : x - window_.x + grid_.width;
    const int j = y - window_.y;
    return i < window_.width && j >= 0 && j < window_.height ? at(i, j) : nullptr;
  }

 private:
  std::size_t index(int i, int j) const {
    return (static_cast<std::size_t>(j) * static_cast<std::size_t>(window_.width) + static_cast<std::size_t>(i)) *
           static_cast<std::size_t>(channels_);
  }

  Grid grid_;
  Window window_;
  int channels_ = 0;
  std::vector<float> data_;
};

}  // namespace nodal::bands
