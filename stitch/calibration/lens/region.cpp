#include "stitch/calibration/lens/region.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "stitch/solve/circle.h"

namespace nodal::calibration {
namespace {

constexpr float kBlack = 0.06F;       // share of the bright end, encoded
constexpr double kBrightLine = 0.25;  // share of a row or column that must be bright
constexpr int kSpokes = 360;
constexpr double kCircleError = 2.0;  // px, rms, for an edge to count as a circle
constexpr double kEdgeError = 0.4;    // px, rms of an edge without outliers: spokes are sampled in steps of 0.5 px

GreyImage brightest(const std::vector<const GreyImage*>& pictures) {
  GreyImage all = *pictures[0];
  for (const GreyImage* picture : pictures) {
    for (std::size_t i = 0; i < all.values.size(); ++i) all.values[i] = std::max(all.values[i], picture->values[i]);
  }
  return all;
}

/// First and last + 1 of the lines with a sufficient share of bright pixels.
std::pair<int, int> bright_lines(const GreyImage& image, float black, bool rows) {
  const int lines = rows ? image.height : image.width;
  const int across = rows ? image.width : image.height;
  int first = lines;
  int last = 0;
  for (int n = 0; n < lines; ++n) {
    int bright = 0;
    for (int k = 0; k < across; ++k) bright += (rows ? image.row(n)[k] : image.row(k)[n]) > black ? 1 : 0;
    if (bright < kBrightLine * across) continue;
    first = std::min(first, n);
    last = n + 1;
  }
  return {first, last};
}

struct Edge {
  std::vector<Eigen::Vector2d> points;
  int spokes = 0;  // spokes that end inside the picture
};

/// The outermost bright point on each spoke from `middle`.
Edge edge_of(const GreyImage& image, float black, const Eigen::Vector2d& middle) {
  Edge edge;
  for (int n = 0; n < kSpokes; ++n) {
    const double angle = 2 * std::numbers::pi * n / kSpokes;
    const Eigen::Vector2d way(std::cos(angle), std::sin(angle));
    double last = -1;
    double end = 0;
    for (double r = 0;; r += 0.5) {
      const Eigen::Vector2d p = middle + r * way;
      if (p.x() < 0 || p.y() < 0 || p.x() >= image.width || p.y() >= image.height) break;
      if (image.row(static_cast<int>(p.y()))[static_cast<int>(p.x())] > black) last = r;
      end = r;
    }
    if (last < 0 || last > end - 3) continue;
    ++edge.spokes;
    edge.points.push_back(middle + last * way);
  }
  return edge;
}

/// Signed distances of the points from the circle, px; negative inside.
std::vector<double> distances(const std::vector<Eigen::Vector2d>& points, const solve::Circle& circle) {
  std::vector<double> all;
  all.reserve(points.size());
  for (const Eigen::Vector2d& p : points) all.push_back(circle.distance(p));
  return all;
}

double rms_of(const std::vector<double>& errors) {
  double square = 0;
  for (const double error : errors) square += error * error;
  return std::sqrt(square / static_cast<double>(errors.size()));
}

/// The circle through at least half of the points, or nothing. Distant points are outliers: a spoke that ends at
/// something dark in the scene ends inside the circle.
std::optional<Region::Circle> circle_through(std::vector<Eigen::Vector2d> points) {
  const std::size_t fewest = std::max<std::size_t>(40, points.size() / 2);
  constexpr int kPasses = 8;
  std::optional<Region::Circle> found;
  for (int pass = 0; pass < kPasses && points.size() >= fewest; ++pass) {
    const solve::Circle circle = solve::fitted_circle(points);
    const std::vector<double> errors = distances(points, circle);
    const double rms = rms_of(errors);
    if (rms < kCircleError) found = Region::Circle{circle.x, circle.y, circle.radius};
    std::vector<Eigen::Vector2d> kept;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (std::abs(errors[i]) < 1.5 * rms) kept.push_back(points[i]);
    }
    if (rms < kEdgeError || kept.size() == points.size()) break;
    points = std::move(kept);
  }
  return found;
}

}  // namespace

Region find_region(const std::vector<const GreyImage*>& pictures) {
  const GreyImage image = brightest(pictures);
  Region region{0, 0, static_cast<double>(image.width), static_cast<double>(image.height), {}};
  std::vector<float> sorted = image.values;
  const auto bright = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() * 95 / 100);
  std::ranges::nth_element(sorted, bright);
  const float black = kBlack * *bright;
  const auto [left, right] = bright_lines(image, black, false);
  const auto [top, bottom] = bright_lines(image, black, true);
  if (left >= right || top >= bottom) return region;
  const Eigen::Vector2d middle((left + right) / 2.0, (top + bottom) / 2.0);
  const Edge edge = edge_of(image, black, middle);
  if (edge.spokes >= kSpokes / 6) {
    // The points of a circular edge fit a circle; those of straight bands do not.
    if (const auto circle = circle_through(edge.points)) {
      region.circle = circle;
      region.circle->radius -= kEdgeBlur;
      return region;
    }
  }
  // The first whole pixel inside a band may be half black.
  if (left > 0) region.left = left + 1;
  if (top > 0) region.top = top + 1;
  if (right < image.width) region.right = right - 1;
  if (bottom < image.height) region.bottom = bottom - 1;
  return region;
}

}  // namespace nodal::calibration
