// The masks of a region: polygons whose inside is not used.
#pragma once

#include <span>
#include <vector>

#include "protocol/calibration.h"
#include "stitch/geometry/ray.h"

namespace nodal::geometry {

/// Threading: immutable; any thread.
/// Ownership: a value.
class Masks {
 public:
  explicit Masks(const Region& region);

  bool empty() const { return polygons_.empty(); }
  /// Distance to the nearest edge of a polygon, px, negative inside one. Distances of `most` or more are returned as
  /// `most`, which spares the polygons that are farther away.
  double distance(Pixel at, double most) const;

 private:
  struct Polygon {
    double left = 0, right = 0, top = 0, bottom = 0;
    std::vector<Region::Point> corners;
  };
  std::vector<Polygon> polygons_;
};

}  // namespace nodal::geometry
