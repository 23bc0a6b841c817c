#include "stitch/timing/rotation_lag.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/solve/robust.h"
#include "stitch/timing/fourier.h"
#include "stitch/timing/peak.h"
#include "stitch/timing/robust_line.h"
#include "stitch/timing/sinc.h"

namespace nodal::timing {
namespace {

constexpr double kMaxHz = 40;         // a rig moves slower than this; what is faster is noise
constexpr double kShareOfRate = 0.4;  // frequencies that samples can show
constexpr double kMeanOver = 2;       // s; slower changes are left out
constexpr double kMinOverlap = 8;     // s
constexpr int kFirstChunks = 8;
constexpr double kMinFirst = 5, kMaxFirst = 60, kMinChunk = 2.5, kMaxChunk = 20;  // s
constexpr int kMaxChunks = 60;
constexpr double kSigmas = 4;
constexpr double kMinLikeness = 0.5;
constexpr double kSecondPeak = 0.8;
constexpr double kMinShareOnLine = 0.7;
constexpr std::size_t kMaxGrid = 40'000'000;

Status check(const Rotation& r, const char* which) {
  const auto bad = [&](const char* why) { return fail(Errc::kBadValue, fmt::format("{} rotation {}", which, why)); };
  if (r.times.size() != r.speeds.size()) return bad("has another number of times than of speeds");
  if (r.times.size() < 3) return bad("has fewer than three samples");
  for (std::size_t i = 0; i < r.times.size(); ++i) {
    if (!std::isfinite(r.times[i]) || !std::isfinite(r.speeds[i])) return bad("has a number that is not finite");
    if (i > 0 && r.times[i] <= r.times[i - 1]) return bad("has times that do not increase");
  }
  return {};
}

double usual_interval(const Rotation& r) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < r.times.size(); ++i) intervals.push_back(r.times[i] - r.times[i - 1]);
  return solve::median(intervals);
}

/// Changes of a speed on an even grid.
struct Grid {
  double start = 0, step = 0;
  std::vector<double> values{};  ///< 0 in gaps
  double end() const { return start + static_cast<double>(values.size()) * step; }
  std::vector<double> piece(double from, double seconds) const {
    const auto size = static_cast<std::int64_t>(values.size());
    const std::int64_t first = std::clamp<std::int64_t>(index_of(from), 0, size);
    const std::int64_t last = std::clamp<std::int64_t>(index_of(from) + std::llround(seconds / step), first, size);
    return {values.begin() + first, values.begin() + last};
  }
  std::int64_t index_of(double time) const { return std::llround((time - start) / step); }
  double time_of(std::int64_t index) const { return start + static_cast<double>(index) * step; }
};

/// A local straight line under Gaussian weights, at every place of the grid; then less its mean over 2 s.
Grid smoothed(const Rotation& r, double sigma, double step, double largest_gap) {
  Grid grid{r.times.front(), step, {}};
  const auto count = static_cast<std::size_t>((r.times.back() - r.times.front()) / step) + 1;
  std::vector<char> known(count, 0);
  grid.values.resize(count);
  std::size_t low = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double time = grid.time_of(static_cast<std::int64_t>(i));
    while (low < r.times.size() && r.times[low] < time - 4 * sigma) ++low;
    double s0 = 0, s1 = 0, s2 = 0, t0 = 0, t1 = 0;
    double before = -1e300, after = 1e300;
    for (std::size_t k = low; k < r.times.size() && r.times[k] <= time + 4 * sigma; ++k) {
      const double x = (r.times[k] - time) / sigma, weight = std::exp(-x * x / 2);
      s0 += weight, s1 += weight * x, s2 += weight * x * x;
      t0 += weight * r.speeds[k], t1 += weight * x * r.speeds[k];
      if (r.times[k] <= time) before = r.times[k];
      if (r.times[k] >= time) after = std::min(after, r.times[k]);
    }
    const double determinant = s0 * s2 - s1 * s1;
    if (after - before > largest_gap || determinant <= 1e-9 * s0 * s0) continue;
    grid.values[i] = (s2 * t0 - s1 * t1) / determinant;
    known[i] = 1;
  }
  std::vector<double> sum(count + 1, 0.0), number(count + 1, 0.0);
  for (std::size_t i = 0; i < count; ++i) {
    sum[i + 1] = sum[i] + grid.values[i];
    number[i + 1] = number[i] + known[i];
  }
  const auto half = static_cast<std::size_t>(std::max(1.0, kMeanOver / 2 / step));
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t from = i - std::min(i, half), to = std::min(count, i + half + 1);
    if (known[i] != 0) grid.values[i] -= (sum[to] - sum[from]) / (number[to] - number[from]);
  }
  return grid;
}

struct FirstLags {
  std::vector<LagPoint> points{};
  int repeating = 0, unlike = 0;
};

FirstLags first_lags(const Grid& a, const Grid& b, double from, double to, const Search& search) {
  FirstLags found;
  const double seconds = std::clamp((to - from) / 2, kMinFirst, kMaxFirst);
  for (int i = 0; i < kFirstChunks; ++i) {
    const double at = from + std::max(0.0, to - from - seconds) * i / (kFirstChunks - 1);
    const auto chunk = a.piece(at, seconds);
    const double b_from = std::max(b.start, at + search.expected - search.reach);
    const auto other = b.piece(b_from, std::min(b.end(), at + seconds + search.expected + search.reach) - b_from);
    if (chunk.empty() || other.size() < chunk.size() + 16) continue;
    const auto likeness = correlation_coefficients(chunk, other);
    const Peak peak = highest_peak(likeness);
    // Motion that repeats is alike at many lags, which makes chance_of() large as well: so it is tested first.
    if (peak.size >= kMinLikeness && peak.second > kSecondPeak * peak.size) {
      ++found.repeating;
    } else if (peak.size < kMinLikeness || peak.size < kSigmas * chance_of(likeness)) {
      ++found.unlike;
    } else {
      const double begin = a.time_of(std::max<std::int64_t>(0, a.index_of(at)));
      const double lag = b.time_of(b.index_of(b_from) + static_cast<std::int64_t>(peak.at)) - begin;
      found.points.push_back({at + seconds / 2, lag});
    }
  }
  return found;
}

std::optional<LagPoint> chunk_lag(const Grid& a, const Grid& b, const Lag& line, double at, double seconds, int margin,
                                  const SincTable& sinc) {
  const auto chunk = a.piece(at, seconds);
  const double begin = a.time_of(a.index_of(at));
  std::vector<double> other(chunk.size() + 2 * static_cast<std::size_t>(margin));
  for (std::size_t i = 0; i < other.size(); ++i) {
    const double time = begin + (static_cast<double>(i) - margin) * a.step;
    other[i] = sinc.value(b.values, (time + line.value(time) - b.start) / b.step);
  }
  const auto likeness = correlation_coefficients(chunk, other);
  const Peak peak = highest_peak(likeness);
  if (peak.size < kMinLikeness || peak.at < 2 || peak.at + 3 > likeness.size()) return std::nullopt;
  const double middle = begin + seconds / 2;
  const double beside = (parabola_peak(likeness, peak.at) - margin) * a.step;
  return LagPoint{middle, line.value(middle) + beside * (1 + line.rate)};
}

}  // namespace

Result<Lag> rotation_lag(const Rotation& a, const Rotation& b, const Search& search) {
  NODAL_TRY(check(a, "the first head's"));
  NODAL_TRY(check(b, "the second head's"));
  const double interval_a = usual_interval(a), interval_b = usual_interval(b);
  const double interval = std::max(interval_a, interval_b);
  const double highest = std::min(kMaxHz, kShareOfRate / interval);
  const double sigma = 0.3 / highest, step = sigma / 2;  // 0.17 of `highest` is left
  for (const Rotation* r : {&a, &b}) {
    if ((r->times.back() - r->times.front()) / step > kMaxGrid) {
      return fail(Errc::kTooLarge, "rotation over more than 80 hours cannot be used; give a part of the film");
    }
  }
  const Grid grid_a = smoothed(a, sigma, step, 3 * interval_a), grid_b = smoothed(b, sigma, step, 3 * interval_b);
  const double from = std::max(grid_a.start, grid_b.start - search.expected - search.reach);
  const double to = std::min(grid_a.end(), grid_b.end() - search.expected + search.reach);
  const std::string shortness = "the films overlap by less than 8 s, too little for their motion";
  if (to - from < kMinOverlap) return fail(Errc::kNotDetermined, shortness);

  const FirstLags first = first_lags(grid_a, grid_b, from, to, search);
  const double tolerance = std::max(2e-3, 0.3 * interval);
  const auto coarse = robust_line(first.points, {.tolerance = 3 * tolerance, .least_scatter = 1e-3});
  const int kept = static_cast<int>(first.points.size());
  if (!coarse || first.repeating > kept) {
    if (first.repeating > first.unlike) return fail(Errc::kNotDetermined, "the motion repeats, so several lags fit it");
    return fail(Errc::kNotDetermined, "the rig is still, turns evenly, or its heads do not turn alike");
  }
  const std::string broken = "the lags of the motion are not on one line: a film was paused or cut";
  if (coarse->used < kMinShareOnLine * kept) return fail(Errc::kNotDetermined, broken);

  const SincTable sinc;
  const double begin = std::max(grid_a.start, grid_b.start - coarse->lag) + 1;
  const double end = std::min(grid_a.end(), grid_b.end() - coarse->lag) - 1;
  if (end - begin < kMinOverlap - 2) return fail(Errc::kNotDetermined, shortness);
  const double seconds = std::clamp((end - begin) / 10, kMinChunk, kMaxChunk);
  const int chunks = std::clamp(static_cast<int>((end - begin) / seconds), 2, kMaxChunks);
  const int margin = static_cast<int>(std::ceil(4 * tolerance / step)) + 3;
  std::vector<LagPoint> points;
  for (int i = 0; i < chunks; ++i) {
    const double at = begin + (end - begin - seconds) * i / (chunks - 1);
    if (const auto point = chunk_lag(grid_a, grid_b, *coarse, at, seconds, margin, sinc)) points.push_back(*point);
  }
  auto fine = robust_line(points, {.tolerance = tolerance, .least_scatter = 1e-3 * interval});
  if (!fine) return fail(Errc::kNotDetermined, "too little of the motion is alike");
  if (fine->used < kMinShareOnLine * static_cast<double>(points.size())) return fail(Errc::kNotDetermined, broken);
  fine->measured = chunks;
  return *fine;
}

}  // namespace nodal::timing
