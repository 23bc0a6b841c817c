#include "stitch/registration/mask_field.h"

#include <cmath>
#include <numbers>

#include "stitch/geometry/masks.h"

namespace nodal::registration {

MaskField::MaskField(const HeadCalibration& head) {
  constexpr int kMaxCells = 512;
  const int cell = (std::max(head.width, head.height) + kMaxCells - 1) / kMaxCells;
  columns_ = (head.width + cell - 1) / cell;
  rows_ = (head.height + cell - 1) / cell;
  per_px_ = 1.0F / static_cast<float>(cell);
  const geometry::Masks masks(head.region);
  constexpr double kFarthest = 1e6;  // px: more than any margin
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const double distance = masks.distance({(column + 0.5) * cell, (row + 0.5) * cell}, kFarthest);
      distance_.push_back(static_cast<float>(distance - cell * std::numbers::sqrt2 / 2));
    }
  }
}

}  // namespace nodal::registration
