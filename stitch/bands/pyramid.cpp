#include "stitch/bands/pyramid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "stitch/bands/interpolation.h"

namespace nodal::bands {
namespace {

double cos_latitude(int y, int height) { return std::sin((y + 0.5) / height * std::numbers::pi); }

/// Half the width of the horizontal filter in row y, in fine pixels.
double reach_in_row(int y, Grid fine, Grid coarse) {
  const double ratio = static_cast<double>(fine.width) / coarse.width;
  return std::min<double>(fine.width, ratio / cos_latitude(y, fine.height));
}

/// Prefix sums of a row's channel, for means over intervals with fractional ends.
class RowSums {
 public:
  /// values(i) for i in 0..count-1.
  template <class Value>
  void set(int count, const Value& value) {
    sums_.resize(static_cast<std::size_t>(count) + 1);
    sums_[0] = 0;
    for (int i = 0; i < count; ++i) {
      sums_[static_cast<std::size_t>(i) + 1] = sums_[static_cast<std::size_t>(i)] + static_cast<double>(value(i));
    }
  }
  double mean(double begin, double end) const { return (until(end) - until(begin)) / (end - begin); }

 private:
  double until(double x) const {
    const double last = static_cast<double>(sums_.size() - 1);
    if (x <= 0) return 0;
    if (x >= last) return sums_.back();
    const auto i = static_cast<std::size_t>(x);
    return sums_[i] + (x - static_cast<double>(i)) * (sums_[i + 1] - sums_[i]);
  }
  std::vector<double> sums_;
};

/// Filters and subsamples one row. A triangle is two boxes, one after the other.
void reduce_row(const Layer& fine, int j, Layer& coarse, RowSums& sums, RowSums& boxed) {
  const Grid grid = fine.grid();
  const Window& from = fine.window();
  const double reach = reach_in_row(from.y + j, grid, coarse.grid());
  const double across = static_cast<double>(grid.width) / coarse.grid().width;
  const int pad = static_cast<int>(std::ceil(reach)) + 2;
  for (int c = 0; c < fine.channels(); ++c) {
    const int count = from.width + 2 * pad;
    sums.set(count, [&](int k) {
      const int i = k - pad;
      if (i >= 0 && i < from.width) return fine.at(i, j)[c];
      if (!fine.closed()) return 0.0F;
      return fine.at((i % from.width + from.width) % from.width, j)[c];
    });
    boxed.set(count, [&](int k) { return sums.mean(k + 0.5 - reach / 2, k + 0.5 + reach / 2); });
    for (int i = 0; i < coarse.window().width; ++i) {
      const double centre = pad + (coarse.window().x + i + 0.5) * across - from.x;
      double mean = boxed.mean(centre - reach / 2, centre + reach / 2);
      // The same column a turn before and after: filters close to a pole reach the window from both sides.
      if (!fine.closed()) {
        for (const int turn : {-grid.width, grid.width}) {
          mean += boxed.mean(centre + turn - reach / 2, centre + turn + reach / 2);
        }
      }
      coarse.at(i, j)[c] = static_cast<float>(mean);
    }
  }
}

struct Tap {
  int row = 0;
  double weight = 0;
};

/// The rows that a coarse row is the mean of; rows below 0 or past the last are those beyond a pole.
std::vector<Tap> taps_of_row(int y, Grid fine, Grid coarse) {
  const double ratio = static_cast<double>(fine.height) / coarse.height;
  const double centre = (y + 0.5) * ratio;
  std::vector<Tap> taps;
  double sum = 0;
  for (int k = static_cast<int>(std::floor(centre - ratio)); k <= static_cast<int>(std::ceil(centre + ratio)); ++k) {
    const double weight = 1 - std::abs(k + 0.5 - centre) / ratio;
    if (weight <= 0) continue;
    taps.push_back({k, weight});
    sum += weight;
  }
  for (Tap& tap : taps) tap.weight /= sum;
  return taps;
}

/// A row of a grid that may be beyond a pole, as the row and the turn in columns.
struct TurnedRow {
  int row = 0;
  int turn = 0;
};
TurnedRow on_sphere(int row, Grid grid) {
  if (row < 0) return {-1 - row, grid.width / 2};
  if (row >= grid.height) return {2 * grid.height - 1 - row, grid.width / 2};
  return {row, 0};
}

}  // namespace

std::vector<Grid> grids_below(Grid finest) {
  std::vector<Grid> grids{finest};
  while (grids.back().width / 2 >= kMinWidth && grids.back().height > 2) {
    grids.push_back({(grids.back().width + 1) / 2, (grids.back().height + 1) / 2});
  }
  return grids;
}

Window reduced_window(Grid fine, const Window& from, Grid coarse) {
  const double down = static_cast<double>(fine.height) / coarse.height;
  const double across = static_cast<double>(fine.width) / coarse.width;
  Window to;
  to.y = std::max(0, static_cast<int>(std::floor(from.y / down)) - 1);
  const int end = std::min(coarse.height, static_cast<int>(std::ceil((from.y + from.height) / down)) + 1);
  to.height = end - to.y;
  const double reach =
      std::max(reach_in_row(from.y, fine, coarse), reach_in_row(from.y + from.height - 1, fine, coarse));
  const int begin = static_cast<int>(std::floor((from.x - reach) / across)) - 1;
  to.width = static_cast<int>(std::ceil((from.x + from.width + reach) / across)) + 1 - begin;
  if (from.width == fine.width || to.width >= coarse.width) {
    to.x = 0;
    to.width = coarse.width;
  } else {
    to.x = (begin % coarse.width + coarse.width) % coarse.width;
  }
  return to;
}

Layer reduced(const Layer& fine, Grid coarse, const parallel::Workers& workers) {
  const Window to = reduced_window(fine.grid(), fine.window(), coarse);
  const Window& from = fine.window();
  const int channels = fine.channels();
  // First each row; the rows are still those of the fine grid.
  Layer rows({coarse.width, fine.grid().height}, {to.x, from.y, to.width, from.height}, channels);
  constexpr int kRowsAtOnce = 32;
  workers.run((from.height + kRowsAtOnce - 1) / kRowsAtOnce, [&](int chunk) {
    RowSums sums, boxed;
    const int end = std::min(from.height, (chunk + 1) * kRowsAtOnce);
    for (int j = chunk * kRowsAtOnce; j < end; ++j) reduce_row(fine, j, rows, sums, boxed);
  });
  Layer made(coarse, to, channels);
  workers.run(to.height, [&](int j) {
    for (const Tap& tap : taps_of_row(to.y + j, fine.grid(), coarse)) {
      const auto [y, turn] = on_sphere(tap.row, rows.grid());
      const auto weight = static_cast<float>(tap.weight);
      for (int i = 0; i < to.width; ++i) {
        const float* source = rows.find((to.x + i + turn) % coarse.width, y);
        if (source == nullptr) continue;
        for (int c = 0; c < channels; ++c) made.at(i, j)[c] += weight * source[c];
      }
    }
  });
  return made;
}

void Expansion::row(int y, int x, int width, std::vector<float>& into) const {
  const Grid grid = coarse_.grid();
  const Window& window = coarse_.window();
  const int channels = coarse_.channels();
  into.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(channels), 0);
  const double v = (y + 0.5) * grid.height / fine_.height - 0.5;
  const int middle = static_cast<int>(std::lround(v));
  const std::array<float, 3> down = spline_weights(v - middle);
  const auto column_of = [&](int i) { return (x + i + 0.5) * grid.width / fine_.width - 0.5; };
  // The coarse columns that are needed, without their turn; the three rows are added up first.
  const int begin = static_cast<int>(std::lround(column_of(0))) - 1;
  const int count = static_cast<int>(std::lround(column_of(width - 1))) + 2 - begin;
  std::vector<float> mixed(static_cast<std::size_t>(count) * static_cast<std::size_t>(channels));
  for (int l = 0; l < 3; ++l) {
    const auto [row, turn] = on_sphere(middle - 1 + l, grid);
    const int j = std::clamp(row - window.y, 0, window.height - 1);
    for (int k = 0; k < count; ++k) {
      int i = (begin + k + turn - window.x + 4 * grid.width) % grid.width;
      // Outside the window, the nearer end.
      if (i >= window.width) i = i - window.width < grid.width - i ? window.width - 1 : 0;
      const float* from = coarse_.at(i, j);
      float* to = mixed.data() + static_cast<std::ptrdiff_t>(k) * channels;
      for (int c = 0; c < channels; ++c) to[c] += down[static_cast<std::size_t>(l)] * from[c];
    }
  }
  for (int i = 0; i < width; ++i) {
    const double u = column_of(i);
    const int centre = static_cast<int>(std::lround(u));
    const std::array<float, 3> across = spline_weights(u - centre);
    const float* from = mixed.data() + static_cast<std::ptrdiff_t>(centre - 1 - begin) * channels;
    float* to = into.data() + static_cast<std::ptrdiff_t>(i) * channels;
    for (int k = 0; k < 3 * channels; ++k) to[k % channels] += across[static_cast<std::size_t>(k / channels)] * from[k];
  }
}

void sample_cubic(const Layer& whole, double u, double v, float* into) {
  const Grid grid = whole.grid();
  const int column = static_cast<int>(std::floor(u - 0.5)), row = static_cast<int>(std::floor(v - 0.5));
  const std::array<float, 4> across = cubic_weights(u - 0.5 - column), down = cubic_weights(v - 0.5 - row);
  std::fill(into, into + whole.channels(), 0.0F);
  for (int l = 0; l < 4; ++l) {
    const auto [y, turn] = on_sphere(row - 1 + l, grid);
    for (int k = 0; k < 4; ++k) {
      const float* pixel = whole.at((column - 1 + k + turn + 2 * grid.width) % grid.width, y);
      const float weight = across[static_cast<std::size_t>(k)] * down[static_cast<std::size_t>(l)];
      for (int c = 0; c < whole.channels(); ++c) into[c] += weight * pixel[c];
    }
  }
}

}  // namespace nodal::bands
