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
  /// Distance to the nearest edge of a polygon, px, negative inside one. A distance of `most` or more is returned as
  /// `most`, so that more distant polygons can be skipped.
  double distance(Pixel at, double most) const;

 private:
  struct Polygon {
    double left = 0, right = 0, top = 0, bottom = 0;
    std::vector<Region::Point> corners;
  };
  std::vector<Polygon> polygons_;
};

}  // namespace nodal::geometry
