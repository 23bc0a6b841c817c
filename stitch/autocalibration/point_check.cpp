#include "stitch/autocalibration/point_check.h"

#include <cmath>
#include <limits>

#include "protocol/base/try.h"
#include "stitch/geometry/head.h"
#include "stitch/solve/robust.h"

namespace nodal::autocalibration {
namespace {

constexpr std::size_t kFewPoints = 16;  // the median of fewer points says little about a head
// Limit of the median of all points: kWorse times that before, plus kWorsePx.
constexpr double kWorse = 1.1, kWorsePx = 0.05;
constexpr double kWorseHead = 1.35, kWorseHeadPx = 0.2;  // the same limit of one head's median

double distance(const geometry::Head& from, geometry::Pixel at, const geometry::Head& to, geometry::Pixel seen) {
  const auto ray = from.unproject(at);
  const auto projected = ray ? to.project(*ray) : std::nullopt;
  return projected ? std::hypot(projected->x - seen.x, projected->y - seen.y) : std::numeric_limits<double>::infinity();
}

}  // namespace

Result<std::vector<double>> point_errors(const Calibration& calibration, const std::vector<Match>& points) {
  NODAL_TRY_ASSIGN(const std::vector<geometry::Head> heads, geometry::make_heads(calibration));
  std::vector<std::vector<double>> errors(heads.size() + 1);
  for (const Match& point : points) {
    const geometry::Head& a = heads[point.a];
    const geometry::Head& b = heads[point.b];
    const double in_b = distance(a, point.pixel_a, b, point.pixel_b),
                 in_a = distance(b, point.pixel_b, a, point.pixel_a);
    errors[point.a].push_back(in_a);
    errors[point.b].push_back(in_b);
    errors.back().push_back(in_a);
    errors.back().push_back(in_b);
  }
  std::vector<double> medians;
  for (std::vector<double>& own : errors) medians.push_back(own.size() < kFewPoints ? 0 : solve::median(own));
  return medians;
}

bool agrees_as_well(const std::vector<double>& before, const std::vector<double>& after) {
  for (std::size_t h = 0; h + 1 < after.size(); ++h) {
    if (after[h] > kWorseHead * before[h] + kWorseHeadPx) return false;
  }
  return after.back() <= kWorse * before.back() + kWorsePx;
}

}  // namespace nodal::autocalibration
