#include "protocol/lens_range.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "protocol/base/angles.h"
#include "protocol/base/polynomial.h"

namespace nodal {
namespace {

/// Larger than any picture's radius, so that a lens without a turning point has an end too.
constexpr double kNoRadius = 1e7;

std::vector<double> through_zero(std::span<const double> from_c1) {
  std::vector<double> c{0.0};
  c.insert(c.end(), from_c1.begin(), from_c1.end());
  return c;
}

std::vector<double> tsai_polynomial(const TsaiLens& lens) { return {0, 1, 0, lens.kappa1, 0, lens.kappa2}; }

std::vector<double> kannala_brandt_polynomial(const KannalaBrandtLens& lens) {
  std::vector<double> c(10, 0.0);
  c[1] = lens.focal;
  for (std::size_t k = 0; k < lens.k.size(); ++k) c[2 * k + 3] = lens.focal * lens.k[k];
  return c;
}

/// x with p(x) = y on [0, upper], where p rises; upper if p does not reach y.
double solve(std::vector<double> c, double y, double upper) {
  c[0] -= y;
  const std::vector<double> roots = polynomial_roots(c, 0, upper);
  return roots.empty() ? upper : roots.front();
}

LensRange range_of(const TsaiLens& lens) {
  if (!(lens.focal > 0)) return {};
  const std::vector<double> ideal = tsai_polynomial(lens);
  const double turning = rising_until(ideal, kNoRadius);
  const double last = solve(ideal, lens.focal * std::tan(kMaxPinholeAngle), turning);
  const double angle = std::min(std::atan(polynomial_value(ideal, last) / lens.focal), kMaxPinholeAngle);
  return {angle, last, last == turning && turning < kNoRadius};
}

LensRange range_of(const RectilinearLens& lens) {
  const std::vector<double> c = through_zero(lens.coefficients);
  const double end = std::tan(kMaxPinholeAngle);
  const double turning = rising_until(c, end);
  return {turning == end ? kMaxPinholeAngle : std::atan(turning), polynomial_value(c, turning), turning < end};
}

LensRange fisheye_range(std::span<const double> c) {
  const double turning = rising_until(c, kPi);
  return {turning, polynomial_value(c, turning), turning < kPi};
}

LensRange range_of(const EquidistantLens& lens) { return fisheye_range(through_zero(lens.coefficients)); }
LensRange range_of(const KannalaBrandtLens& lens) { return fisheye_range(kannala_brandt_polynomial(lens)); }

double radius_at(const TsaiLens& lens, double angle) {
  return solve(tsai_polynomial(lens), lens.focal * std::tan(angle), range_of(lens).max_radius);
}
double radius_at(const RectilinearLens& lens, double angle) {
  return polynomial_value(through_zero(lens.coefficients), std::tan(angle));
}
double radius_at(const EquidistantLens& lens, double angle) {
  return polynomial_value(through_zero(lens.coefficients), angle);
}
double radius_at(const KannalaBrandtLens& lens, double angle) {
  return polynomial_value(kannala_brandt_polynomial(lens), angle);
}

struct Point {
  double x, y;
};

/// The points of the region's boundary that can be farthest from any given point: corners inside the circle, points of
/// the circle inside the rectangle, and intersections of the two.
std::vector<Point> boundary_points(const Region& region) {
  std::vector<Point> points;
  const auto in_rectangle = [&](Point p) {
    return p.x >= region.left && p.x <= region.right && p.y >= region.top && p.y <= region.bottom;
  };
  const auto in_circle = [&](Point p) {
    return !region.circle || std::hypot(p.x - region.circle->x, p.y - region.circle->y) <= region.circle->radius;
  };
  for (const double x : {region.left, region.right}) {
    for (const double y : {region.top, region.bottom}) {
      if (in_circle({x, y})) points.push_back({x, y});
    }
  }
  if (!region.circle) return points;
  const auto [cx, cy, radius] = *region.circle;
  const auto add = [&](Point p) {
    if (in_rectangle(p)) points.push_back(p);
  };
  for (const double sign : {-1.0, 1.0}) {
    for (const double x : {region.left, region.right}) {
      const double h = radius * radius - (x - cx) * (x - cx);
      if (h >= 0) add({x, cy + sign * std::sqrt(h)});
    }
    for (const double y : {region.top, region.bottom}) {
      const double h = radius * radius - (y - cy) * (y - cy);
      if (h >= 0) add({cx + sign * std::sqrt(h), y});
    }
  }
  constexpr int kSteps = 1440;  // a quarter of a degree each: the farthest radius is at most 2e-6 too small
  for (int step = 0; step < kSteps; ++step) {
    const double angle = 2 * kPi * step / kSteps;
    add({cx + radius * std::cos(angle), cy + radius * std::sin(angle)});
  }
  return points;
}

}  // namespace

LensRange lens_range(const LensModel& lens) {
  return std::visit([](const auto& model) { return range_of(model); }, lens);
}

double lens_radius(const LensModel& lens, double angle) {
  return std::visit([angle](const auto& model) { return radius_at(model, angle); }, lens);
}

double farthest_radius(const Region& region, double x, double y, double aspect) {
  double farthest = 0;
  for (const Point p : boundary_points(region)) farthest = std::max(farthest, std::hypot(p.x - x, (p.y - y) / aspect));
  return farthest;
}

}  // namespace nodal
