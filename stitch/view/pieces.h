// Which neighbouring pixels of a raymap are neighbours on the sphere.
#pragma once

#include <cstdint>
#include <vector>

#include "stitch/geometry/raymap/layout.h"
#include "stitch/parallel/workers.h"

namespace nodal::view {

/// Threading: immutable; any thread.
class Pieces {
 public:
  /// Rays of neighbouring pixels that are farther apart, in pixels, belong to different faces.
  static constexpr double kFar = 5;
  static constexpr int kBlock = 16;

  Pieces(const geometry::RaymapLayout& layout, const parallel::Workers& workers);

  /// Rows are whole circles of latitude: the first pixel follows the last, and no row has an edge.
  bool wraps() const { return wraps_; }
  /// Whether the pixels (i - reach, j - reach) .. (i + 1 + reach, j + 1 + reach) are one piece of the sphere.
  bool joined(int i, int j, int reach) const;
  /// Whether the pixels left..right, top..bottom (inclusive) are in the picture and one piece. May be false for a piece
  /// close to an edge.
  bool all_joined(int left, int top, int right, int bottom) const;

 private:
  void join(const geometry::RaymapLayout& layout, int block_row);
  std::size_t square(int i, int j) const {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(i);
  }

  int width_, height_, blocks_across_;
  bool wraps_ = false;
  /// For each pixel (i, j), whether the square of pixels (i, j) .. (i + 1, j + 1) is one piece. Empty if all are, or
  /// none.
  std::vector<std::uint8_t> squares_;
  /// For each block of kBlock x kBlock squares, whether all of them are.
  std::vector<std::uint8_t> blocks_;
};

}  // namespace nodal::view
