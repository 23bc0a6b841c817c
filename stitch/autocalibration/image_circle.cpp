#include "stitch/autocalibration/image_circle.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "stitch/solve/circle.h"

namespace nodal::autocalibration {
namespace {

constexpr int kSpokes = 720;
constexpr double kDark = 45;       // levels; light outside of the circle is darker
constexpr double kRise = 2.5;      // the level inside the edge is at least that outside times this
constexpr double kRiseLevels = 8;  // plus this many levels
constexpr double kNear = 0.012;    // how far an edge's point may be from the circle, share of the radius
constexpr int kFewestPoints = kSpokes / 8;
constexpr double kMinSpokeShare = 1.0 / 3;  // share of the spokes that must end at an edge
constexpr double kSmallest = 0.6;           // radius / half of the shorter side
constexpr double kLargest = 1.2;            // radius / half of the diagonal
constexpr int kTried = 2000;

// The means of the picture along a spoke, from the middle outwards, one per pixel.
std::vector<double> levels_along(const Picture& picture, const Eigen::Vector2d& middle, const Eigen::Vector2d& way) {
  std::vector<double> levels;
  for (double r = 0;; ++r) {
    const Eigen::Vector2d p = middle + r * way;
    if (p.x() < 0 || p.y() < 0 || p.x() >= picture.width || p.y() >= picture.height) return levels;
    levels.push_back(double{picture.at(static_cast<int>(p.x()), static_cast<int>(p.y()))});
  }
}

// The outermost radius at which a dark border ends, or nothing.
std::optional<double> edge_on(const std::vector<double>& levels, std::size_t window) {
  if (levels.size() < 8 * window) return std::nullopt;
  std::vector<double> sums{0};
  for (const double level : levels) sums.push_back(sums.back() + level);
  const auto mean = [&](std::size_t from) { return (sums[from + window] - sums[from]) / static_cast<double>(window); };
  if (mean(levels.size() - window) > kDark) return std::nullopt;
  for (std::size_t r = levels.size() - window; r >= 2 * window; --r) {
    const double outside = mean(r), inside = mean(r - window);
    if (outside > kDark) return std::nullopt;
    if (inside >= kRise * outside + kRiseLevels) return static_cast<double>(r);
  }
  return std::nullopt;
}

std::vector<Eigen::Vector2d> near(const solve::Circle& circle, const std::vector<Eigen::Vector2d>& points) {
  std::vector<Eigen::Vector2d> kept;
  std::ranges::copy_if(points, std::back_inserter(kept),
                       [&](const Eigen::Vector2d& p) { return std::abs(circle.distance(p)) < kNear * circle.radius; });
  return kept;
}

// `window`: px, about as wide as the edge's blur.
std::optional<Region::Circle> circle_with(const Picture& picture, std::size_t window) {
  const Eigen::Vector2d middle(picture.width / 2.0, picture.height / 2.0);
  std::vector<Eigen::Vector2d> points;
  for (int n = 0; n < kSpokes; ++n) {
    const double angle = 2 * std::numbers::pi * n / kSpokes;
    const Eigen::Vector2d way(std::cos(angle), std::sin(angle));
    if (const auto r = edge_on(levels_along(picture, middle, way), window)) points.push_back(middle + *r * way);
  }
  if (static_cast<int>(points.size()) < kFewestPoints) return std::nullopt;
  const auto plausible = [&](const solve::Circle& circle) {
    return circle.radius > kSmallest * std::min(picture.width, picture.height) / 2 &&
           circle.radius < kLargest * std::hypot(picture.width, picture.height) / 2;
  };
  // Circles through three points, a regular subset of all: the same one in every run.
  std::vector<Eigen::Vector2d> best;
  const std::size_t count = points.size();
  for (int t = 0; t < kTried; ++t) {
    const auto at = [&](std::size_t step) { return points[static_cast<std::size_t>(t) * step % count]; };
    const std::vector<Eigen::Vector2d> three{at(1), at(271), at(613)};
    const solve::Circle circle = solve::fitted_circle(three);
    if (!plausible(circle)) continue;
    if (std::vector<Eigen::Vector2d> kept = near(circle, points); kept.size() > best.size()) best = std::move(kept);
  }
  if (static_cast<int>(best.size()) < kFewestPoints ||
      static_cast<double>(best.size()) < kMinSpokeShare * static_cast<double>(count)) {
    return std::nullopt;
  }
  solve::Circle circle = solve::fitted_circle(best);
  best = near(circle, points);
  circle = solve::fitted_circle(best);
  if (!plausible(circle)) return std::nullopt;
  // Moves the circle to the inner side of the edge.
  std::vector<double> offs;
  for (const Eigen::Vector2d& p : best) offs.push_back(circle.distance(p));
  const auto tenth = offs.begin() + static_cast<std::ptrdiff_t>(offs.size() / 10);
  std::ranges::nth_element(offs, tenth);
  circle.radius += *tenth - static_cast<double>(window) / 2;
  return Region::Circle{circle.x, circle.y, circle.radius};
}

}  // namespace

std::optional<Region::Circle> find_image_circle(const Picture& picture) {
  const int side = std::max(picture.width, picture.height);
  for (const int window : {side / 120, side / 40}) {
    if (const auto circle = circle_with(picture, static_cast<std::size_t>(std::max(3, window)))) return circle;
  }
  return std::nullopt;
}

}  // namespace nodal::autocalibration
