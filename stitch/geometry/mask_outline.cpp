#include "stitch/geometry/mask_outline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "protocol/base/try.h"

namespace nodal::geometry {
namespace {

using Point = Region::Point;
using Loop = std::vector<Point>;

constexpr int kLargestBlock = 32;            // px
constexpr int kMinBlocks = 24;               // along the picture's longer side: fewer would hide much that is visible
constexpr double kMaxLost = 0.1;             // share of the picture that polygons may cover beyond the hidden pixels
constexpr std::size_t kMaxTraced = 200'000;  // corners of all outlines before they are simplified
constexpr double kTolerance = 0.98;          // blocks; less than the block by which masks are grown
constexpr double kGrown = 3;                 // blocks by which a simplified polygon may be too large

/// Blocks of `by` pixels, hidden if they or a neighbouring block have a hidden pixel, with a visible border.
HiddenPixels in_blocks(const HiddenPixels& hidden, int by) {
  HiddenPixels blocks{(hidden.width + by - 1) / by + 4, (hidden.height + by - 1) / by + 4, {}};
  blocks.values.resize(static_cast<std::size_t>(blocks.width) * static_cast<std::size_t>(blocks.height));
  for (int y = 0; y < hidden.height; ++y) {
    for (int x = 0; x < hidden.width; ++x) {
      if (!hidden.at(x, y)) continue;
      for (int j = -1; j <= 1; ++j) {
        for (int i = -1; i <= 1; ++i) blocks.hide(x / by + 2 + i, y / by + 2 + j);
      }
    }
  }
  return blocks;
}

/// For every block the number of the connected part that it belongs to, from 1 on; 0: visible. Blocks that share only a
/// corner are connected.
std::vector<int> parts_of(const HiddenPixels& blocks, int& parts) {
  std::vector<int> part(blocks.values.size(), 0);
  std::vector<std::pair<int, int>> open;
  const auto index = [&](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(blocks.width) + static_cast<std::size_t>(x);
  };
  for (int y = 1; y + 1 < blocks.height; ++y) {
    for (int x = 1; x + 1 < blocks.width; ++x) {
      if (!blocks.at(x, y) || part[index(x, y)] != 0) continue;
      part[index(x, y)] = ++parts;
      open.emplace_back(x, y);
      while (!open.empty()) {
        const auto [cx, cy] = open.back();
        open.pop_back();
        for (int j = cy - 1; j <= cy + 1; ++j) {
          for (int i = cx - 1; i <= cx + 1; ++i) {
            if (!blocks.at(i, j) || part[index(i, j)] != 0) continue;
            part[index(i, j)] = parts;
            open.emplace_back(i, j);
          }
        }
      }
    }
  }
  return part;
}

/// A direction along the edges of blocks: right, down, left, up.
constexpr std::array<std::pair<int, int>, 4> kSteps{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};

/// Follows edges between hidden and visible blocks, with the hidden block at the right, and keeps the corners.
class Tracer {
 public:
  explicit Tracer(const HiddenPixels& blocks) : blocks_(blocks), seen_(blocks.values.size(), 0) {}

  /// The outline that begins with the upper edge of this block, whose upper neighbour is visible; empty if it was
  /// traced before.
  Loop from_upper_edge(int x, int y) {
    if (seen_[index(x, y)] != 0) return {};
    Loop loop;
    int cx = x, cy = y, direction = 0;
    do {
      if (direction == 0) seen_[index(cx, cy)] = 1;
      cx += kSteps[static_cast<std::size_t>(direction)].first;
      cy += kSteps[static_cast<std::size_t>(direction)].second;
      const int next = turned(cx, cy, direction);
      if (next != direction) loop.push_back({static_cast<double>(cx), static_cast<double>(cy)});
      direction = next;
    } while (cx != x || cy != y || direction != 0);
    return loop;
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(blocks_.width) + static_cast<std::size_t>(x);
  }
  /// The block at the left or at the right of the edge that leaves this corner in a direction.
  bool beside(int x, int y, int direction, bool right) const {
    // Blocks around the corner by the edge that has them at the right: (0, 0) is at the right of the step to the right.
    constexpr std::array<std::pair<int, int>, 4> kRight{{{0, 0}, {-1, 0}, {-1, -1}, {0, -1}}};
    const auto [i, j] = kRight[static_cast<std::size_t>(right ? direction : (direction + 3) % 4)];
    return blocks_.at(x + i, y + j);
  }
  /// Where the outline goes on: to the left if it can, so that blocks that share a corner have one outline.
  int turned(int x, int y, int direction) const {
    for (const int turn : {3, 0, 1}) {
      const int next = (direction + turn) % 4;
      if (beside(x, y, next, true) && !beside(x, y, next, false)) return next;
    }
    return (direction + 2) % 4;  // not reached: an outline always goes on
  }

  const HiddenPixels& blocks_;
  std::vector<std::uint8_t> seen_;
};

double distance_to_line(const Point& from, const Point& to, const Point& at) {
  const double ex = to.x - from.x, ey = to.y - from.y, px = at.x - from.x, py = at.y - from.y;
  const double length2 = ex * ex + ey * ey;
  const double t = length2 > 0 ? std::clamp((px * ex + py * ey) / length2, 0.0, 1.0) : 0;
  return std::hypot(px - t * ex, py - t * ey);
}

/// Corners that are needed so that no other one is farther than `tolerance` from the outline (Douglas and Peucker).
Loop simplified(const Loop& loop, double tolerance) {
  const std::size_t count = loop.size();
  std::size_t far = 0;
  for (std::size_t k = 1; k < count; ++k) {
    const auto off = [&](std::size_t n) { return std::hypot(loop[n].x - loop[0].x, loop[n].y - loop[0].y); };
    if (off(k) > off(far)) far = k;
  }
  std::vector<bool> kept(count);
  kept[0] = kept[far] = true;
  std::vector<std::pair<std::size_t, std::size_t>> open{{0, far}, {far, count}};
  while (!open.empty()) {
    const auto [from, to] = open.back();
    open.pop_back();
    std::size_t worst = from;
    double most = tolerance;
    for (std::size_t k = from + 1; k < to; ++k) {
      const double off = distance_to_line(loop[from], loop[to % count], loop[k]);
      if (off > most) most = off, worst = k;
    }
    if (worst == from) continue;
    kept[worst] = true;
    open.emplace_back(from, worst);
    open.emplace_back(worst, to);
  }
  Loop simple;
  for (std::size_t k = 0; k < count; ++k) {
    if (kept[k]) simple.push_back(loop[k]);
  }
  return simple;
}

/// The shortest way from a corner of one outline to an edge of another.
struct Bridge {
  double length = std::numeric_limits<double>::infinity();
  std::size_t corner = 0, edge = 0;
  Point landing;
};

void look_for_bridge(const Loop& corners, const Loop& edges, Bridge& best) {
  for (std::size_t c = 0; c < corners.size(); ++c) {
    for (std::size_t e = 0; e < edges.size(); ++e) {
      const Point &at = corners[c], &from = edges[e], &to = edges[(e + 1) % edges.size()];
      const double ex = to.x - from.x, ey = to.y - from.y, length2 = ex * ex + ey * ey;
      const double t = length2 > 0 ? std::clamp(((at.x - from.x) * ex + (at.y - from.y) * ey) / length2, 0.0, 1.0) : 0;
      const Point landing{from.x + t * ex, from.y + t * ey};
      const double length = std::hypot(landing.x - at.x, landing.y - at.y);
      if (length < best.length) best = {length, c, e, landing};
    }
  }
}

/// `outer` with `inner` connected to it.
Loop connected(const Loop& outer, const Loop& inner) {
  Bridge from_inner, from_outer;
  look_for_bridge(inner, outer, from_inner);
  look_for_bridge(outer, inner, from_outer);
  const bool landed_outside = from_inner.length <= from_outer.length;
  Loop loop;
  const auto round = [&loop](const Loop& whole, std::size_t first) {
    for (std::size_t k = 0; k < whole.size(); ++k) loop.push_back(whole[(first + k) % whole.size()]);
  };
  if (landed_outside) {
    round(outer, from_inner.edge + 1);
    loop.push_back(from_inner.landing);
    round(inner, from_inner.corner);
    loop.push_back(inner[from_inner.corner]);
    loop.push_back(from_inner.landing);
  } else {
    round(outer, from_outer.corner);
    loop.push_back(outer[from_outer.corner]);
    loop.push_back(from_outer.landing);
    round(inner, from_outer.edge + 1);
    loop.push_back(from_outer.landing);
  }
  return loop;
}

double area_of(const Loop& loop) {
  double twice = 0;
  for (std::size_t k = 0; k < loop.size(); ++k) {
    const Point &a = loop[k], &b = loop[(k + 1) % loop.size()];
    twice += a.x * b.y - b.x * a.y;
  }
  return twice / 2;
}

/// One polygon for each connected part, in blocks; nothing if there are more than a calibration may have.
std::optional<std::vector<Loop>> polygons_of(const HiddenPixels& blocks, double tolerance) {
  int parts = 0;
  const std::vector<int> part = parts_of(blocks, parts);
  if (static_cast<std::size_t>(parts) > kMaxMasks) return std::nullopt;
  std::vector<Loop> outer(static_cast<std::size_t>(parts));
  std::vector<std::vector<Loop>> inner(static_cast<std::size_t>(parts));
  Tracer tracer(blocks);
  std::size_t traced = 0, corners = 0;
  for (int y = 1; y + 1 < blocks.height; ++y) {
    for (int x = 1; x + 1 < blocks.width; ++x) {
      if (!blocks.at(x, y) || blocks.at(x, y - 1)) continue;
      const Loop loop = tracer.from_upper_edge(x, y);
      if (loop.empty()) continue;
      traced += loop.size();
      if (traced > kMaxTraced) return std::nullopt;
      const auto n = static_cast<std::size_t>(
          part[static_cast<std::size_t>(y) * static_cast<std::size_t>(blocks.width) + static_cast<std::size_t>(x)] - 1);
      Loop simple = tolerance > 0 ? simplified(loop, tolerance) : loop;
      if (simple.size() < 3) continue;
      corners += simple.size();
      if (corners > kMaxMaskPoints) return std::nullopt;
      if (area_of(loop) > 0) outer[n] = std::move(simple);
      else inner[n].push_back(std::move(simple));
    }
  }
  corners = 0;
  for (std::size_t n = 0; n < outer.size(); ++n) {
    if (outer[n].empty()) return std::nullopt;
    for (const Loop& hole : inner[n]) outer[n] = connected(outer[n], hole);
    corners += outer[n].size();
  }
  return corners <= kMaxMaskPoints ? std::optional(std::move(outer)) : std::nullopt;
}

double hidden_px(const HiddenPixels& blocks, int by) {
  return static_cast<double>(std::ranges::count(blocks.values, 1)) * by * by;
}

/// From blocks with their border to pixels.
std::vector<Loop> in_pixels(std::vector<Loop> polygons, int by) {
  for (Loop& loop : polygons) {
    for (Point& point : loop) point = {(point.x - 2) * by, (point.y - 2) * by};
  }
  return polygons;
}

}  // namespace

Result<MaskOutline> outline_of(const HiddenPixels& hidden) {
  if (auto exact = polygons_of(in_blocks(hidden, 1), 0)) return MaskOutline{in_pixels(std::move(*exact), 1), 1};
  const int longer = std::max(hidden.width, hidden.height);
  for (int by = 1; by <= kLargestBlock && longer / by >= kMinBlocks; by *= 2) {
    const HiddenPixels blocks = in_blocks(hidden, by);
    if (hidden_px(blocks, by) - hidden_px(hidden, 1) > kMaxLost * hidden.width * hidden.height) break;
    if (auto found = polygons_of(blocks, kTolerance)) {
      return MaskOutline{in_pixels(std::move(*found), by), kGrown * by};
    }
  }
  return fail(Errc::kTooLarge, "the mask has too many small parts; draw a few larger areas");
}

}  // namespace nodal::geometry
