// The distance of each point of a head's picture from its masks, on a coarse grid, for fast lookup.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "protocol/calibration.h"

namespace nodal::registration {

/// Threading: immutable; any thread.
/// Ownership: a value.
class MaskField {
 public:
  /// Cells of one pixel, or larger ones in pictures of more than 512 px. 1 MiB at most.
  explicit MaskField(const HeadCalibration& head);

  /// Whether the point (px) is masked or within `margin` px of a mask. May also be true up to a cell's diagonal beyond.
  bool hides(float u, float v, float margin) const {
    const auto cell = [](float at, float per_px, int count) {
      const float place = at * per_px;  // NaN goes to the first cell
      return place > 0 ? static_cast<std::size_t>(std::min(place, static_cast<float>(count - 1))) : std::size_t{0};
    };
    return distance_[cell(v, per_px_, rows_) * static_cast<std::size_t>(columns_) + cell(u, per_px_, columns_)] <
           margin;
  }

 private:
  int columns_ = 0, rows_ = 0;
  float per_px_ = 1;
  std::vector<float> distance_;  ///< px, from the nearest point of each cell
};

}  // namespace nodal::registration
