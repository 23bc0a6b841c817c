// The rays of a picture that is made from a raymap.
#pragma once

#include <functional>
#include <optional>

#include "stitch/geometry/ray.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::view {

struct Target {
  int width = 0;
  int height = 0;
  /// The ray at continuous coordinates; nothing where the picture is black.
  std::function<std::optional<geometry::Ray>(double x, double y)> ray;
  /// Solid angle of every pixel of a scattered layout, sr. Otherwise 0: the pixel's own outline is its footprint.
  double pixel_sr = 0;
  /// Same meaning as RaymapLayout::smooth().
  bool smooth = false;

  static Target of(const geometry::RaymapLayout& layout);
};

}  // namespace nodal::view
