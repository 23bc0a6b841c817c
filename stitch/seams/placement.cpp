#include "stitch/seams/placement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "stitch/bands/interpolation.h"
#include "stitch/seams/max_flow.h"

namespace nodal::seams {
namespace {

using bands::Layer;
using bands::Window;

constexpr int kMaxRounds = 4;       ///< all heads, in turn; the cost rarely falls after the second round
constexpr double kUnit = 1.0 / 64;  ///< levels per unit of the integer costs
/// Between two pixels that no two heads see both, levels.
constexpr double kUnknown = 40;
constexpr int kCoarsest = 256;  ///< columns of the map on which seams are placed anywhere
constexpr int kBand = 8;        ///< pixels by which a finer map moves the seams of a coarser one

/// The part of the map outside of which no head sees anything: the rows, and the columns unless they go around.
Window seen_part(std::span<const Layer> views) {
  const bands::Grid grid = views.front().grid();
  int left = grid.width, right = 0, top = grid.height, bottom = 0;
  for (const Layer& view : views) {
    const Window& window = view.window();
    if (window.width <= 0 || window.height <= 0) continue;
    const bool around = window.x + window.width > grid.width;
    left = around ? 0 : std::min(left, window.x);
    right = around ? grid.width : std::max(right, window.x + window.width);
    top = std::min(top, window.y);
    bottom = std::max(bottom, window.y + window.height);
  }
  return {left, top, std::max(0, right - left), std::max(0, bottom - top)};
}

/// Costs of labels on the map.
class Costs {
 public:
  Costs(std::span<const Layer> views, const Labels& previous, const PlacementOptions& options)
      : views_(views), previous_(previous), options_(options), grid_(views.front().grid()), part_(seen_part(views)) {
    best_.resize(static_cast<std::size_t>(grid_.width) * static_cast<std::size_t>(grid_.height));
    for (std::size_t h = 0; h < views.size(); ++h) {
      for_pixels([&](int x, int y) { best_[index(x, y)] = std::max(best_[index(x, y)], score(h, x, y)); });
    }
  }

  bands::Grid grid() const { return grid_; }
  /// Visits every pixel that a head may see: visit(x, y).
  template <class Visit>
  void for_pixels(const Visit& visit) const {
    for (int y = part_.y; y < part_.y + part_.height; ++y) {
      for (int x = part_.x; x < part_.x + part_.width; ++x) visit(x, y);
    }
  }
  /// Visits the neighbours to the right (around the circle) and below of every such pixel: visit(x, y, x2, y2).
  template <class Visit>
  void for_neighbours(const Visit& visit) const {
    for_pixels([&](int x, int y) {
      visit(x, y, (x + 1) % grid_.width, y);
      if (y + 1 < grid_.height) visit(x, y, x, y + 1);
    });
  }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(grid_.width) + static_cast<std::size_t>(x);
  }
  float score(std::size_t head, int x, int y) const {
    const float* pixel = views_[head].find(x, y);
    return pixel == nullptr ? 0 : pixel[views_[head].channels() - 1];
  }
  bool seen(std::size_t head, int x, int y) const { return score(head, x, y) > 0; }
  bool seen_by_any(int x, int y) const { return best_[index(x, y)] > 0; }

  /// Cost of showing a head at a pixel.
  double of(std::size_t head, int x, int y) const {
    const double area = std::sin((y + 0.5) / grid_.height * std::numbers::pi);
    double cost = options_.score * (1 - static_cast<double>(score(head, x, y) / best_[index(x, y)]));
    if (!previous_.empty() && previous_[index(x, y)] != kNobody && previous_[index(x, y)] != head)
      cost += options_.change;
    return cost * area;
  }

  /// Cost of two neighbours of which one shows head a, the other head b. The second pixel is right of the first one or
  /// below it.
  double between(std::size_t a, std::size_t b, int x, int y, int x2, int y2) const {
    if (a == b) return 0;
    double sum = 0, count = 0;
    add_difference(a, b, x, y, sum, count);
    add_difference(a, b, x2, y2, sum, count);
    const double seam = options_.length + (count > 0 ? sum / count : kUnknown);
    // The length of the seam between them: a row's height, or a column's width.
    return y == y2 ? seam : seam * std::sin(static_cast<double>(y2) / grid_.height * std::numbers::pi);
  }

 private:
  void add_difference(std::size_t a, std::size_t b, int x, int y, double& sum, double& count) const {
    const float* p = views_[a].find(x, y);
    const float* q = views_[b].find(x, y);
    const int colours = views_[a].channels() - 1;
    if (p == nullptr || q == nullptr || !(p[colours] > 0) || !(q[colours] > 0)) return;
    float off = 0;
    for (int c = 0; c < colours; ++c) off += std::abs(p[c] - q[c]);
    sum += std::clamp<double>(static_cast<double>(off) / colours - options_.noise, 0, options_.largest);
    ++count;
  }

  std::span<const Layer> views_;
  const Labels& previous_;
  PlacementOptions options_;
  bands::Grid grid_;
  Window part_;
  std::vector<float> best_;
};

/// Each pixel's previous head if that still sees it, else the one with the best score.
Labels first_labels(const Costs& costs, std::size_t heads, const Labels& previous) {
  const bands::Grid grid = costs.grid();
  Labels labels(static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height), kNobody);
  costs.for_pixels([&](int x, int y) {
    std::uint8_t& label = labels[costs.index(x, y)];
    float best = 0;
    for (std::size_t h = 0; h < heads; ++h) {
      if (costs.score(h, x, y) <= best) continue;
      best = costs.score(h, x, y);
      label = static_cast<std::uint8_t>(h);
    }
    if (previous.empty()) return;
    const std::uint8_t before = previous[costs.index(x, y)];
    if (before != kNobody && costs.seen(before, x, y)) label = before;
  });
  return labels;
}

MaxFlow::Capacity units(double cost) { return std::llround(cost / kUnit); }

/// Marks the pixels that are at most kBand columns and rows from a change of the label.
std::vector<bool> around_seams(const Costs& costs, const Labels& labels) {
  const bands::Grid grid = costs.grid();
  std::vector<bool> marked(labels.size());
  const auto mark = [&](int x, int y) {
    for (int j = std::max(0, y - kBand); j <= std::min(grid.height - 1, y + kBand); ++j) {
      for (int i = -kBand; i <= kBand; ++i) {
        const int column = (x + i + grid.width) % grid.width;
        marked[static_cast<std::size_t>(j) * static_cast<std::size_t>(grid.width) + static_cast<std::size_t>(column)] =
            true;
      }
    }
  };
  costs.for_neighbours([&](int x, int y, int x2, int y2) {
    if (labels[costs.index(x, y)] != labels[costs.index(x2, y2)]) mark(x, y);
  });
  return marked;
}

/// Lets pixels that are marked (all if `movable` is empty) go over to `alpha` where that lowers the cost. Returns how
/// many did.
///
/// The source's side keeps its head. For two neighbours that may both go over, with costs A (both keep), B (only the
/// second goes) and C (only the first goes), the graph has C - A and -C on the terminals and B + C - A on the edge
/// (Kolmogorov and Zabih, PAMI 2004).
std::size_t expand(const Costs& costs, std::uint8_t alpha, const std::vector<bool>& movable, Labels& labels) {
  std::vector<std::int32_t> nodes(labels.size(), -1);
  std::int32_t count = 0;
  costs.for_pixels([&](int x, int y) {
    const std::size_t p = costs.index(x, y);
    if (!movable.empty() && !movable[p]) return;
    if (labels[p] != kNobody && labels[p] != alpha && costs.seen(alpha, x, y)) nodes[p] = count++;
  });
  if (count == 0) return 0;
  MaxFlow graph(count);
  graph.reserve(2 * static_cast<std::size_t>(count));
  // To go over costs the edge from the source, to keep costs the edge to the sink.
  const auto cost_to_go = [&](std::int32_t node, MaxFlow::Capacity cost) { graph.add_terminals(node, cost, 0); };
  costs.for_neighbours([&](int x, int y, int x2, int y2) {
    const std::size_t p = costs.index(x, y), q = costs.index(x2, y2);
    const std::int32_t m = nodes[p], n = nodes[q];
    if (labels[p] == kNobody || labels[q] == kNobody || (m < 0 && n < 0)) return;
    const MaxFlow::Capacity keep = units(costs.between(labels[p], labels[q], x, y, x2, y2));
    const MaxFlow::Capacity first = m < 0 ? 0 : units(costs.between(alpha, labels[q], x, y, x2, y2));
    const MaxFlow::Capacity second = n < 0 ? 0 : units(costs.between(labels[p], alpha, x, y, x2, y2));
    if (n < 0) return cost_to_go(m, first - keep);
    if (m < 0) return cost_to_go(n, second - keep);
    cost_to_go(m, first - keep);
    cost_to_go(n, -first);
    // Differences that are cut off at `largest` or seen by few may break the triangle inequality: then 0.
    graph.add_edge(m, n, std::max<MaxFlow::Capacity>(0, first + second - keep), 0);
  });
  costs.for_pixels([&](int x, int y) {
    const std::size_t p = costs.index(x, y);
    if (nodes[p] >= 0) cost_to_go(nodes[p], units(costs.of(alpha, x, y)) - units(costs.of(labels[p], x, y)));
  });
  graph.solve();
  std::size_t changed = 0;
  for (std::size_t p = 0; p < labels.size(); ++p) {
    if (nodes[p] < 0 || graph.with_source(nodes[p])) continue;
    labels[p] = alpha;
    ++changed;
  }
  return changed;
}

double cost_of(const Costs& costs, const Labels& labels) {
  double sum = 0;
  costs.for_pixels([&](int x, int y) {
    if (labels[costs.index(x, y)] != kNobody) sum += costs.of(labels[costs.index(x, y)], x, y);
  });
  costs.for_neighbours([&](int x, int y, int x2, int y2) {
    const std::uint8_t a = labels[costs.index(x, y)], b = labels[costs.index(x2, y2)];
    if (a != kNobody && b != kNobody) sum += costs.between(a, b, x, y, x2, y2);
  });
  return sum;
}

/// The view on half as many columns and rows: means of the pixels that the head sees.
Layer halved(const Layer& view) {
  const Window from = view.window();
  const bands::Grid grid{view.grid().width / 2, view.grid().height / 2};
  Window window{from.x / 2, from.y / 2, 0, 0};
  if (from.width > 0 && from.height > 0) {
    window.width = std::min(grid.width, (from.x + from.width - 1) / 2 - window.x + 1);
    window.height = (from.y + from.height - 1) / 2 - window.y + 1;
  }
  Layer half(grid, window, view.channels());
  const int score = view.channels() - 1;
  for (int j = 0; j < window.height; ++j) {
    for (int i = 0; i < window.width; ++i) {
      float* pixel = half.at(i, j);
      float count = 0;
      for (int k = 0; k < 4; ++k) {
        const int x = (2 * (window.x + i) + k % 2) % view.grid().width, y = 2 * (window.y + j) + k / 2;
        const float* fine = view.find(x, y);
        if (fine == nullptr || !(fine[score] > 0)) continue;
        for (int c = 0; c <= score; ++c) pixel[c] += fine[c];
        ++count;
      }
      for (int c = 0; c <= score && count > 0; ++c) pixel[c] /= count;
    }
  }
  return half;
}

/// Labels of a map of half the size, on the map of `costs`; where their head does not see a pixel, the best head's.
Labels doubled(const Costs& costs, std::size_t heads, const Labels& half) {
  const bands::Grid grid = costs.grid();
  Labels labels = first_labels(costs, heads, {});
  costs.for_pixels([&](int x, int y) {
    const std::size_t at = static_cast<std::size_t>(y / 2) * static_cast<std::size_t>(grid.width / 2);
    const std::uint8_t label = half[at + static_cast<std::size_t>(x / 2)];
    if (label != kNobody && costs.seen(label, x, y)) labels[costs.index(x, y)] = label;
  });
  return labels;
}

/// Labels without a set before: on a coarse map anywhere, then on finer ones near the coarser map's seams.
Labels start_coarse(std::span<const Layer> views, const PlacementOptions& options) {
  std::vector<Layer> half;
  for (const Layer& view : views) half.push_back(halved(view));
  // A pixel has four times the area there, but a seam's pixel only twice the length.
  PlacementOptions coarse = options;
  coarse.score *= 2;
  return place_seams(half, {}, coarse);
}

}  // namespace

Labels place_seams(std::span<const Layer> views, const Labels& previous, const PlacementOptions& options) {
  const Costs costs(views, previous, options);
  const bands::Grid grid = costs.grid();
  const bool fine = previous.empty() && grid.width >= 2 * kCoarsest && grid.width % 2 == 0 && grid.height % 2 == 0;
  Labels labels =
      fine ? doubled(costs, views.size(), start_coarse(views, options)) : first_labels(costs, views.size(), previous);
  const std::vector<bool> movable = fine ? around_seams(costs, labels) : std::vector<bool>();
  double least = cost_of(costs, labels);
  for (int round = 0; round < kMaxRounds; ++round) {
    std::size_t changed = 0;
    for (std::size_t alpha = 0; alpha < views.size(); ++alpha) {
      Labels tried = labels;
      if (expand(costs, static_cast<std::uint8_t>(alpha), movable, tried) == 0) continue;
      const double cost = cost_of(costs, tried);
      if (cost >= least) continue;
      changed = 1;
      least = cost;
      labels = std::move(tried);
    }
    if (changed == 0) break;
  }
  return labels;
}

double cost_of(std::span<const Layer> views, const Labels& labels, const PlacementOptions& options) {
  return cost_of(Costs(views, {}, options), labels);
}

void shares_at(const Labels& labels, bands::Grid map, double u, double v, std::vector<Share>& shares) {
  shares.clear();
  const int column = static_cast<int>(std::floor(u)), row = static_cast<int>(std::floor(v));
  const std::array<float, 3> across = bands::spline_weights(u - column - 0.5);
  const std::array<float, 3> down = bands::spline_weights(v - row - 0.5);
  for (int l = 0; l < 3; ++l) {
    const int y = std::clamp(row - 1 + l, 0, map.height - 1);
    for (int k = 0; k < 3; ++k) {
      const int x = (column - 1 + k + map.width) % map.width;
      const std::uint8_t head =
          labels[static_cast<std::size_t>(y) * static_cast<std::size_t>(map.width) + static_cast<std::size_t>(x)];
      if (head == kNobody) continue;
      const float part = across[static_cast<std::size_t>(k)] * down[static_cast<std::size_t>(l)];
      const auto known = std::ranges::find(shares, head, &Share::head);
      if (known == shares.end()) shares.push_back({head, part});
      else known->part += part;
    }
  }
  std::ranges::sort(shares, [](const Share& a, const Share& b) { return a.part > b.part; });
}

}  // namespace nodal::seams
