#include "stitch/timing/flash_lag.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/solve/normal_equations.h"
#include "stitch/solve/robust.h"

namespace nodal::timing {
namespace {

constexpr int kNeighbours = 3;  // frames to each side that a frame is compared with
constexpr double kSigmas = 8;
constexpr double kMinExcess = 3;       // levels
constexpr double kRateSigma = 100e-6;  // rates of clocks, before anything is measured
constexpr std::size_t kMaxFlashes = 200;

Status check(const Brightness& b) {
  const std::size_t frames = b.times.size();
  if (b.rows < 1 || b.luma.size() != frames * static_cast<std::size_t>(b.rows)) {
    return fail(Errc::kBadValue, "the brightness of frames has another number of values than frames and rows");
  }
  for (std::size_t i = 0; i < frames; ++i) {
    if (!std::isfinite(b.times[i]) || (i > 0 && b.times[i] <= b.times[i - 1])) {
      return fail(Errc::kBadValue, "the times of frames do not increase");
    }
  }
  return {};
}

/// What each band of rows is brighter by than in the frames around.
std::vector<double> excess_of(const Brightness& b) {
  const auto frames = static_cast<int>(b.times.size());
  std::vector<double> excess(b.luma.size());
  std::vector<double> around;
  for (int n = 0; n < frames; ++n) {
    for (int r = 0; r < b.rows; ++r) {
      around.clear();
      for (int k = std::max(0, n - kNeighbours); k <= std::min(frames - 1, n + kNeighbours); ++k) {
        if (k != n) around.push_back(b.luma[static_cast<std::size_t>(k * b.rows + r)]);
      }
      const auto at = static_cast<std::size_t>(n * b.rows + r);
      excess[at] = b.luma[at] - solve::median(around);
    }
  }
  return excess;
}

/// The row, from the top, below which a frame is not lit; nothing if it is lit to the bottom.
std::optional<double> lower_edge(std::span<const double> excess) {
  const double half = std::ranges::max(excess) / 2;
  std::size_t last = excess.size() - 1;
  while (excess[last] < half) --last;
  if (last + 1 == excess.size()) return std::nullopt;
  return static_cast<double>(last) + 0.5 + (excess[last] - half) / (excess[last] - excess[last + 1]);
}

/// Flashes that both heads saw if the lag is `lag`.
struct Match {
  double lag = 0;
  std::vector<std::pair<Flash, Flash>> pairs{};
};

Match match_at(double lag, std::span<const Flash> a, std::span<const Flash> b, double drift) {
  Match match{lag, {}};
  for (const Flash& x : a) {
    const Flash* best = nullptr;
    for (const Flash& y : b) {
      const double off = std::abs(y.time - x.time - lag);
      if (off > 4 * std::hypot(x.sigma, y.sigma) + drift) continue;
      if (best == nullptr || off < std::abs(best->time - x.time - lag)) best = &y;
    }
    if (best != nullptr) match.pairs.push_back({x, *best});
  }
  return match;
}

Lag line_through(const Match& match) {
  double centre = 0;
  for (const auto& [x, y] : match.pairs) centre += x.time / static_cast<double>(match.pairs.size());
  solve::NormalEquations equations(2);
  for (const auto& [x, y] : match.pairs) {
    const double slope[] = {1, x.time - centre};
    equations.add(slope, -(y.time - x.time), 1 / (x.sigma * x.sigma + y.sigma * y.sigma));
  }
  const double slope_of_prior[] = {0, 1};
  equations.add(slope_of_prior, 0, 1 / (kRateSigma * kRateSigma));
  const Eigen::VectorXd found = equations.step(0, {});
  const Eigen::MatrixXd covariance = equations.covariance({});
  Lag lag{.at = centre,
          .lag = found[0],
          .rate = found[1],
          .lag_variance = covariance(0, 0),
          .rate_variance = covariance(1, 1),
          .covariance = covariance(0, 1)};
  double squares = 0;
  for (const auto& [x, y] : match.pairs) squares += std::pow(y.time - x.time - lag.value(x.time), 2);
  lag.scatter = std::sqrt(squares / static_cast<double>(match.pairs.size()));
  return lag;
}

}  // namespace

std::vector<Flash> flashes_of(const Brightness& b) {
  std::vector<Flash> flashes;
  const std::size_t frames = b.times.size(), rows = static_cast<std::size_t>(b.rows);
  if (frames < 2 * kNeighbours) return flashes;
  const std::vector<double> excess = excess_of(b);
  std::vector<double> sizes;
  for (const double e : excess) sizes.push_back(std::abs(e));
  const double limit = std::max(kMinExcess, kSigmas * solve::kSigmaPerMedian * solve::median(sizes));
  const auto frame = [&](std::size_t n) { return std::span<const double>(excess).subspan(n * rows, rows); };
  const auto lit = [&](std::size_t n) { return std::ranges::max(frame(n)) > limit; };
  for (std::size_t n = 0; n < frames; ++n) {
    if (!lit(n)) continue;
    std::size_t last = n;
    while (last + 1 < frames && lit(last + 1)) ++last;
    const bool is_short = last - n < 2;
    const double interval = last + 1 < frames ? b.times[last + 1] - b.times[last] : b.times[last] - b.times[last - 1];
    n = last;
    if (!is_short) continue;
    const bool by_row = b.rows > 1 && b.readout > 0;
    const auto edge = by_row ? lower_edge(frame(last)) : std::nullopt;
    if (edge) {
      flashes.push_back({b.times[last] + b.readout * *edge / b.rows, 0.3 * b.readout / b.rows + 20e-6});
    } else {
      // After the last row began, and before the next frame's first one did.
      const double from = by_row ? std::min(b.readout, interval) : 0, gap = interval - from;
      flashes.push_back({b.times[last] + from + gap / 2, gap / std::sqrt(12.0) + 20e-6});
    }
  }
  return flashes;
}

Result<Lag> flash_lag(const Brightness& a, const Brightness& b, const Search& search) {
  NODAL_TRY(check(a));
  NODAL_TRY(check(b));
  const std::vector<Flash> in_a = flashes_of(a), in_b = flashes_of(b);
  if (in_a.empty() || in_b.empty()) return fail(Errc::kNotDetermined, "there is no flash");
  if (in_a.size() > kMaxFlashes || in_b.size() > kMaxFlashes) {
    return fail(Errc::kNotDetermined, "the light flickers, so flashes cannot be told apart");
  }
  const double drift = kRateBound * (in_a.back().time - in_a.front().time);
  std::vector<Match> matches;
  for (const Flash& x : in_a) {
    for (const Flash& y : in_b) {
      const double lag = y.time - x.time;
      if (std::abs(lag - search.expected) <= search.reach) matches.push_back(match_at(lag, in_a, in_b, drift));
    }
  }
  const auto best = std::ranges::max_element(matches, {}, [](const Match& m) { return m.pairs.size(); });
  if (best == matches.end() || 2 * best->pairs.size() < std::min(in_a.size(), in_b.size())) {
    return fail(Errc::kNotDetermined, "the flashes of the two heads do not match");
  }
  Lag lag = line_through(*best);
  for (const Match& other : matches) {
    const bool is_another = std::abs(other.lag - lag.value(in_a.front().time)) > 0.1 + 2 * drift;
    if (is_another && 3 * other.pairs.size() >= 2 * best->pairs.size()) {
      return fail(Errc::kNotDetermined, "the flashes fit several lags");
    }
  }
  lag.measured = static_cast<int>(std::min(in_a.size(), in_b.size()));
  lag.used = static_cast<int>(best->pairs.size());
  return lag;
}

}  // namespace nodal::timing
