#include "stitch/geometry/masks.h"

#include <algorithm>
#include <cmath>

namespace nodal::geometry {
namespace {

/// Squared distance to the nearest edge, and the winding number: not 0 inside the polygon.
struct Place {
  double square = 0;
  int winding = 0;
};

Place place_in(std::span<const Region::Point> corners, Pixel at) {
  Place place{1e300, 0};
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const Region::Point& from = corners[k];
    const Region::Point& to = corners[k + 1 < corners.size() ? k + 1 : 0];
    const double ex = to.x - from.x, ey = to.y - from.y, px = at.x - from.x, py = at.y - from.y;
    const double length2 = ex * ex + ey * ey;
    const double t = length2 > 0 ? std::clamp((px * ex + py * ey) / length2, 0.0, 1.0) : 0.0;
    const double dx = px - t * ex, dy = py - t * ey;
    place.square = std::min(place.square, dx * dx + dy * dy);
    // An edge counts if it crosses the pixel's row to the right of the pixel; half-open, so that a corner counts once.
    const double side = ex * py - ey * px;
    if (from.y <= at.y && to.y > at.y && side > 0) ++place.winding;
    if (from.y > at.y && to.y <= at.y && side < 0) --place.winding;
  }
  return place;
}

}  // namespace

Masks::Masks(const Region& region) {
  for (const std::vector<Region::Point>& mask : region.masks) {
    Polygon polygon{1e300, -1e300, 1e300, -1e300, mask};
    for (const Region::Point& corner : mask) {
      polygon.left = std::min(polygon.left, corner.x);
      polygon.right = std::max(polygon.right, corner.x);
      polygon.top = std::min(polygon.top, corner.y);
      polygon.bottom = std::max(polygon.bottom, corner.y);
    }
    polygons_.push_back(std::move(polygon));
  }
}

double Masks::distance(Pixel at, double most) const {
  double nearest = most;
  for (const Polygon& polygon : polygons_) {
    const double beside = std::max(polygon.left - at.x, at.x - polygon.right);
    const double above = std::max(polygon.top - at.y, at.y - polygon.bottom);
    if (std::max(beside, above) >= nearest) continue;
    const Place place = place_in(polygon.corners, at);
    const double distance = std::sqrt(place.square);
    nearest = std::min(nearest, place.winding != 0 ? -distance : distance);
  }
  return nearest;
}

}  // namespace nodal::geometry
