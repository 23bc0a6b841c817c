#include "stitch/offline/sight_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace nodal::offline {
namespace {

/// Sides of cells, px. The error of a position is proportional to the square of a cell's size, which is why wide grids
/// have more cells.
constexpr int kMinCell = 2, kMaxCell = 16;

Sighting between(const Sighting& a, const Sighting& b, double t) {
  const auto mixed = [t](double from, double to) { return from + t * (to - from); };
  return {{mixed(a.pixel.x, b.pixel.x), mixed(a.pixel.y, b.pixel.y)},
          mixed(a.density, b.density),
          mixed(a.score, b.score),
          mixed(a.inside, b.inside)};
}

}  // namespace

SightGrid::SightGrid(const HeadView& head, HeadPicture::Moved moved, bands::Grid grid, const bands::Window& window,
                     int around, const parallel::Workers& workers)
    : head_(head),
      moved_(std::move(moved)),
      grid_(grid),
      window_(window),
      size_(std::clamp(grid.width / around, kMinCell, kMaxCell)),
      around_((grid.width + size_ - 1) / size_) {
  if (window.width == 0 || window.height == 0) return;
  first_column_ = window.x / size_;
  first_row_ = window.y / size_;
  rows_ = (window.y + window.height - 1) / size_ - first_row_ + 1;
  const int last = (window.x + window.width - 1) % grid.width / size_;
  columns_ = window.width + size_ > grid.width ? around_ : (last - first_column_ + around_) % around_ + 1;
  nodes_.resize(node(0, rows_ + 1));
  workers.run(rows_ + 1, [&](int row) {
    for (int column = 0; column <= columns_; ++column) nodes_[node(column, row)] = sight(left_of(column), top_of(row));
  });
  cells_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  workers.run(rows_, [&](int row) {
    for (int column = 0; column < columns_; ++column) {
      cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column)] =
          cell_at(column, row);
    }
  });
}

int SightGrid::left_of(int column) const {
  const int cell = first_column_ + column;
  return cell < around_ ? cell * size_ : grid_.width + (cell - around_) * size_;
}

std::optional<Sighting> SightGrid::sight(double x, double y) const {
  if (y >= grid_.height) return std::nullopt;  // beyond the pole
  return head_.see(moved_(ray_of(grid_, x + 0.5, y + 0.5)));
}

SightGrid::Cell SightGrid::cell_at(int column, int row) const {
  const auto seen = [&](int i, int j) -> const std::optional<Sighting>& { return nodes_[node(i, j)]; };
  const std::array<const std::optional<Sighting>*, 4> corners{&seen(column, row), &seen(column + 1, row),
                                                              &seen(column, row + 1), &seen(column + 1, row + 1)};
  if (std::ranges::none_of(corners, [](const auto* corner) { return corner->has_value(); })) {
    // A corner of a picture may reach into the cell from a neighbour.
    for (int j = std::max(0, row - 1); j <= std::min(rows_, row + 2); ++j) {
      for (int i = std::max(0, column - 1); i <= std::min(columns_, column + 2); ++i) {
        if (seen(i, j)) return Cell::kEach;
      }
    }
    return Cell::kNone;
  }
  if (!std::ranges::all_of(corners, [](const auto* corner) { return corner->has_value(); })) return Cell::kEach;
  // Farther from every edge and mask than the cell is wide, in the picture's pixels.
  double width = 0;
  for (const auto* one : corners) {
    for (const auto* other : corners) {
      width = std::max(width, std::hypot((*one)->pixel.x - (*other)->pixel.x, (*one)->pixel.y - (*other)->pixel.y));
    }
  }
  for (const auto* corner : corners) {
    if ((*corner)->inside < width) return Cell::kEach;
  }
  const int left = left_of(column), top = top_of(row);
  for (const double across : {0.25, 0.75}) {
    for (const double down : {0.25, 0.75}) {
      const auto exact = sight(left + across * (left_of(column + 1) - left), top + down * (top_of(row + 1) - top));
      if (!exact) return Cell::kEach;
      const Sighting near =
          between(between(**corners[0], **corners[1], across), between(**corners[2], **corners[3], across), down);
      if (std::hypot(near.pixel.x - exact->pixel.x, near.pixel.y - exact->pixel.y) > kMaxOffPx) return Cell::kEach;
    }
  }
  return Cell::kInterpolated;
}

std::optional<Sighting> SightGrid::near(double u, double v) const {
  const int pixel = static_cast<int>(u);
  const int i = pixel >= window_.x ? pixel - window_.x : pixel - window_.x + grid_.width;
  const int j = static_cast<int>(v) - window_.y;
  if (i >= window_.width || j < 0 || j >= window_.height) return std::nullopt;
  // The left half of the grid's first column lies in its last cell.
  const double x = u < 0.5 ? u - 0.5 + grid_.width : u - 0.5, y = v - 0.5;
  const int column = (static_cast<int>(x) / size_ - first_column_ + around_) % around_;
  const int row = y < 0 ? -1 : static_cast<int>(y) / size_ - first_row_;
  if (column >= columns_ || row < 0) return sight(x, y);  // half a pixel outside of the cells
  switch (
      cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column)]) {
    case Cell::kNone: return std::nullopt;
    case Cell::kEach: return sight(x, y);
    case Cell::kInterpolated: break;
  }
  // Beyond the grid's edge, cells go on counting where it ends.
  const double along = first_column_ + column < around_ ? x : x + grid_.width;
  const int left = left_of(column), top = top_of(row);
  const double across = (along - left) / (left_of(column + 1) - left);
  const double down = (y - top) / (top_of(row + 1) - top);
  return between(between(*nodes_[node(column, row)], *nodes_[node(column + 1, row)], across),
                 between(*nodes_[node(column, row + 1)], *nodes_[node(column + 1, row + 1)], across), down);
}

double SightGrid::interpolated() const {
  if (cells_.empty()) return 0;
  return static_cast<double>(std::ranges::count(cells_, Cell::kInterpolated)) / static_cast<double>(cells_.size());
}

}  // namespace nodal::offline
