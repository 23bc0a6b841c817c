#include "stitch/timing/robust_line.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "stitch/solve/normal_equations.h"

namespace nodal::timing {
namespace {

constexpr int kMinOnLine = 3;
constexpr std::size_t kMaxPairs = 4000;

struct Line {
  double at = 0, lag = 0, rate = 0;
  double distance(const LagPoint& p) const { return std::abs(p.lag - lag - rate * (p.at - at)); }
};

/// How well a line fits: lags within the tolerance, then their squared distances.
struct Support {
  int count = 0;
  double squares = 0;
  bool better_than(const Support& other) const {
    return count != other.count ? count > other.count : squares < other.squares;
  }
};

Support support_of(const Line& line, std::span<const LagPoint> points, double tolerance) {
  Support support;
  for (const LagPoint& p : points) {
    const double distance = line.distance(p);
    if (distance > tolerance) continue;
    ++support.count;
    support.squares += distance * distance;
  }
  return support;
}

Line most_supported(std::span<const LagPoint> points, double tolerance) {
  const std::size_t pairs = points.size() * (points.size() - 1) / 2;
  const std::size_t stride = pairs / kMaxPairs + 1;
  Line best;
  Support best_support;
  std::size_t pair = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t k = i + 1; k < points.size(); ++k) {
      if (pair++ % stride != 0) continue;
      const double apart = points[k].at - points[i].at;
      Line line{points[i].at, points[i].lag, apart != 0 ? (points[k].lag - points[i].lag) / apart : 0.0};
      if (std::abs(line.rate) > kRateBound) {
        // Two lags that are close in time leave the rate open; the line that is level decides whether they agree.
        if (std::abs(points[k].lag - points[i].lag) > tolerance) continue;
        line.rate = 0;
      }
      const Support support = support_of(line, points, tolerance);
      if (support.better_than(best_support)) {
        best = line;
        best_support = support;
      }
    }
  }
  return best;
}

}  // namespace

std::optional<Lag> robust_line(std::span<const LagPoint> points, const LineOptions& options) {
  if (points.size() < kMinOnLine) return std::nullopt;
  Line line = most_supported(points, options.tolerance);
  double limit = options.tolerance;
  Lag fit;
  for (int round = 0; round < 4; ++round) {
    std::vector<LagPoint> on_line;
    for (const LagPoint& p : points) {
      if (line.distance(p) <= limit) on_line.push_back(p);
    }
    if (on_line.size() < kMinOnLine) return std::nullopt;
    double centre = 0;
    for (const LagPoint& p : on_line) centre += p.at / static_cast<double>(on_line.size());
    // Unknowns: the lag at the centre, and the rate, of which its prior is one more residual.
    const double scatter_before = std::max(options.least_scatter, fit.scatter);
    solve::NormalEquations equations(2);
    for (const LagPoint& p : on_line) {
      const double slope[] = {1, p.at - centre};
      equations.add(slope, -p.lag, 1 / (scatter_before * scatter_before));
    }
    const double slope_of_prior[] = {0, 1};
    equations.add(slope_of_prior, 0, 1 / (options.rate_sigma * options.rate_sigma));
    const Eigen::VectorXd found = equations.step(0, {});
    line = {centre, found[0], found[1]};
    double squares = 0;
    for (const LagPoint& p : on_line) squares += line.distance(p) * line.distance(p);
    const double freedom = static_cast<double>(on_line.size()) - 2;
    const double scatter = std::sqrt(squares / freedom);
    // The scatter of few lags may be small by chance: Student's distribution is this much wider.
    const double wider = freedom > 2 ? freedom / (freedom - 2) : 4;
    const double variance = std::max(scatter * scatter * wider, options.least_scatter * options.least_scatter);
    const Eigen::MatrixXd covariance = equations.covariance({}) * (variance / (scatter_before * scatter_before));
    fit = {.at = centre,
           .lag = found[0],
           .rate = found[1],
           .lag_variance = covariance(0, 0),
           .rate_variance = std::min(covariance(1, 1), options.rate_sigma * options.rate_sigma),
           .covariance = covariance(0, 1),
           .measured = static_cast<int>(points.size()),
           .used = static_cast<int>(on_line.size()),
           .scatter = scatter};
    limit = std::min(options.tolerance, 3.5 * std::max(scatter, options.least_scatter));
  }
  return fit;
}

}  // namespace nodal::timing
