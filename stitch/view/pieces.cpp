#include "stitch/view/pieces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "stitch/geometry/biquadratic.h"

namespace nodal::view {
namespace {

using geometry::Biquadratic;
using geometry::Ray;
using geometry::RaymapLayout;

bool rows_are_circles(const RaymapLayout& layout) {
  for (const double y : {0.5, 0.3 * layout.height(), 0.5 * layout.height()}) {
    const std::optional<Ray> left = layout.ray(0, y), right = layout.ray(layout.width(), y);
    if (!left || !right || !(geometry::angle_between(*left, *right) < 1e-9)) return false;
    for (const double part : {0.1, 0.25, 0.45, 0.8}) {
      const std::optional<Ray> ray = layout.ray(part * layout.width(), y);
      if (!ray || !(std::abs(ray->y() - left->y()) < 1e-9)) return false;
    }
  }
  return true;
}

/// Which neighbours of a block, and of the pixels right of it and below, are neighbours on the sphere.
class Neighbours {
 public:
  Neighbours(const RaymapLayout& layout, int left, int top, int right, int bottom)
      : layout_(layout), left_(left), top_(top) {
    for (int j = top; j <= bottom; ++j) {
      for (int i = left; i <= right; ++i) {
        at(i, j) = {layout.ray(i + 0.5, j + 0.5), std::sqrt(layout.solid_angle(i, j)), false, false};
      }
    }
    for (int j = top; j <= bottom; ++j) {
      for (int i = left; i <= right; ++i) {
        Its& its = at(i, j);
        its.across = i < right && near(its, at(i + 1, j)) && meet(i + 1, j + 0.5, 1e-6, 0, its.pitch);
        its.below = j < bottom && near(its, at(i, j + 1)) && meet(i + 0.5, j + 1, 0, 1e-6, its.pitch);
      }
    }
  }

  /// Whether the square of pixels (i, j) .. (i + 1, j + 1) is one piece.
  bool joined(int i, int j) { return at(i, j).across && at(i, j + 1).across && at(i, j).below && at(i + 1, j).below; }

 private:
  struct Its {
    std::optional<Ray> ray;
    double pitch;  ///< rad
    bool across, below;
  };
  Its& at(int i, int j) { return all_[static_cast<std::size_t>((j - top_) * (Pieces::kBlock + 1) + i - left_)]; }
  /// Just on both sides of the edge between two pixels, rays differ by less than a quarter of a pixel.
  bool meet(double x, double y, double dx, double dy, double pitch) const {
    const std::optional<Ray> a = layout_.ray(x - dx, y - dy), b = layout_.ray(x + dx, y + dy);
    return a && b && (a->direction() - b->direction()).norm() < 0.25 * pitch;
  }
  /// An edge that crosses both pixels aslant may miss that point, but then their own rays are far apart.
  static bool near(const Its& a, const Its& b) {
    return a.ray && b.ray && (a.ray->direction() - b.ray->direction()).norm() < Pieces::kFar * a.pitch;
  }

  const RaymapLayout& layout_;
  int left_, top_;
  std::array<Its, (Pieces::kBlock + 1) * (Pieces::kBlock + 1)> all_;
};

}  // namespace

Pieces::Pieces(const RaymapLayout& layout, const parallel::Workers& workers)
    : width_(layout.width()), height_(layout.height()), blocks_across_((layout.width() + kBlock - 1) / kBlock) {
  if (layout.scattered()) return;
  wraps_ = rows_are_circles(layout);
  if (wraps_) return;
  squares_.assign(square(0, height_), 0);
  const int rows = (height_ + kBlock - 1) / kBlock;
  blocks_.assign(static_cast<std::size_t>(blocks_across_) * static_cast<std::size_t>(rows), 0);
  workers.run(rows, [&](int row) { join(layout, row); });
}

void Pieces::join(const RaymapLayout& layout, int block_row) {
  const int top = block_row * kBlock, bottom = std::min(top + kBlock, height_ - 1);
  for (int block = 0; block < blocks_across_; ++block) {
    const int left = block * kBlock, right = std::min(left + kBlock, width_ - 1);
    std::uint8_t& all = blocks_[static_cast<std::size_t>(block_row * blocks_across_ + block)];
    // Faces are convex in the picture: if the rays at the block's corners are in one, so are those between. Were they
    // not, no polynomial would fit.
    const bool whole = layout.smooth() && bottom - top == kBlock && right - left == kBlock;
    const auto ray = [&](double i, double j) -> std::optional<Eigen::Vector3d> {
      const double stretch = static_cast<double>(kBlock) / (Biquadratic<3>::kSide - 1);
      const std::optional<Ray> found = layout.ray(left + 0.5 + i * stretch, top + 0.5 + j * stretch);
      return found ? std::optional(found->direction()) : std::nullopt;
    };
    const double pitch = std::sqrt(layout.solid_angle(left + kBlock / 2, std::min(top + kBlock / 2, height_ - 1)));
    all = whole && Biquadratic<3>::fit(ray, pitch / 16) ? 1 : 0;
    bool each = right > left && bottom > top;
    std::optional<Neighbours> neighbours;
    if (all == 0 && each) neighbours.emplace(layout, left, top, right, bottom);
    for (int j = top; j < bottom; ++j) {
      for (int i = left; i < right; ++i) {
        const bool joined = !neighbours || neighbours->joined(i, j);
        squares_[square(i, j)] = joined ? 1 : 0;
        each = each && joined;
      }
    }
    all = each ? 1 : 0;
  }
}

bool Pieces::joined(int i, int j, int reach) const {
  if (j - reach < 0 || j + 1 + reach >= height_) return false;
  if (wraps_) return true;
  if (squares_.empty() || i - reach < 0 || i + 1 + reach >= width_) return false;
  for (int y = j - reach; y <= j + reach; ++y) {
    for (int x = i - reach; x <= i + reach; ++x) {
      if (squares_[square(x, y)] == 0) return false;
    }
  }
  return true;
}

bool Pieces::all_joined(int left, int top, int right, int bottom) const {
  if (left < 0 || top < 0 || right >= width_ || bottom >= height_) return false;
  if (wraps_) return true;
  if (blocks_.empty()) return false;
  for (int y = top / kBlock; y <= bottom / kBlock; ++y) {
    for (int x = left / kBlock; x <= right / kBlock; ++x) {
      if (blocks_[static_cast<std::size_t>(y * blocks_across_ + x)] == 0) return false;
    }
  }
  return true;
}

}  // namespace nodal::view
