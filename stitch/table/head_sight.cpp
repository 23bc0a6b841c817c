#include "stitch/table/head_sight.h"

#include <algorithm>
#include <cmath>

namespace nodal::table {
namespace {

/// With seams, weights decrease this many times faster towards masks than towards the edges of a region.
constexpr double kMaskSteepness = 10;

}  // namespace

double half_of_region(const Region& region) {
  const double half = std::min(region.right - region.left, region.bottom - region.top) / 2;
  return region.circle ? std::min(half, region.circle->radius) : half;
}

std::optional<HeadSight> see(const geometry::Head& head, const TabledLens& lens, const Eigen::Vector3d& d,
                             double depth_per_px) {
  const double sine = std::sqrt(d.x() * d.x() + d.y() * d.y());
  const std::optional<TabledLens::Radius> r = lens.radius(sine, d.z());
  constexpr double kOnAxis = 1e-9;
  if (!r || (sine <= kOnAxis && d.z() < 0)) return std::nullopt;  // exactly behind it is a circle, not a pixel
  const HeadCalibration& c = head.calibration();
  const double across = sine > kOnAxis ? r->radius / sine : r->slope;  // its limit on the axis is the slope
  const double x = across * d.x();
  const double y = c.aspect * across * d.y();
  HeadSight seen{{c.center_x + x, c.center_y + y}, c.aspect * r->slope * across, 1e30, 1};
  const geometry::Pixel at = seen.pixel;
  const auto edge = [&](double distance) {
    seen.inside = std::min(seen.inside, distance);
    const double t = distance * depth_per_px;
    if (!(t >= 1)) seen.depth *= smoothstep(t);  // 1 from there on
  };
  const Region& region = c.region;
  edge(at.x - region.left);
  edge(region.right - at.x);
  edge(at.y - region.top);
  edge(region.bottom - at.y);
  if (region.circle) {
    const double dx = at.x - region.circle->x;
    const double dy = at.y - region.circle->y;
    edge(region.circle->radius - std::sqrt(dx * dx + dy * dy));
  }
  const double stretch = c.aspect != 1 && r->radius > 0 ? std::sqrt(x * x + y * y) / r->radius : 1;
  edge((head.lens().max_radius() - r->radius) * stretch);
  if (!head.masks().empty()) {
    // A mask hides one object: the weight reaches its full value close to it, so that seams elsewhere do not move.
    const double steep = kMaskSteepness * depth_per_px;
    const double distance = head.masks().distance(at, std::max(seen.inside, 1 / steep));
    seen.inside = std::min(seen.inside, distance);
    seen.depth *= smoothstep(distance * steep);
  }
  return seen;
}

}  // namespace nodal::table
