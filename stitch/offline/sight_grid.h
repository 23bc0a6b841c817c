// Where a head's picture is sampled for the pixels of a grid, mostly interpolated: projecting every pixel takes far
// longer than blending it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "stitch/bands/layer.h"
#include "stitch/offline/head_picture.h"
#include "stitch/parallel/workers.h"

namespace nodal::offline {

/// What a head sees of the pixels of a window.
///
/// Threading: immutable; any thread.
/// Ownership: keeps the head by reference.
class SightGrid {
 public:
  /// Pixels of the picture by which an interpolated position may be off.
  static constexpr double kMaxOffPx = 1.0 / 32;

  /// `moved`: the head's ray for a ray of the grid. Empty for a window without pixels. `around`: about how many cells a
  /// circle has: as many as the flow that moves rays has columns, which is linear between these.
  SightGrid(const HeadView& head, HeadPicture::Moved moved, bands::Grid grid, const bands::Window& window, int around,
            const parallel::Workers& workers);

  /// At a position in the grid, in pixels from its upper left corner, 0 <= u < its width, 0 <= v < its height: nothing
  /// in pixels outside the window, or where the head does not see.
  std::optional<Sighting> near(double u, double v) const;
  /// The same for the centre of the pixel in column x and row y.
  std::optional<Sighting> at(int x, int y) const { return near(x + 0.5, y + 0.5); }
  /// The share of cells in which positions are interpolated, 0 .. 1.
  double interpolated() const;

 private:
  enum class Cell : std::uint8_t { kEach, kNone, kInterpolated };

  /// At a position in pixels from the centre of the grid's first one, where all positions of nodes are.
  std::optional<Sighting> sight(double x, double y) const;
  Cell cell_at(int column, int row) const;
  /// The grid's column of the left edge of a cell, beyond its width after the grid's edge; columns_: of the right edge
  /// of the last one. Cells are parts of the grid, whatever the window, and the last one of the circle may be narrower.
  int left_of(int column) const;
  int top_of(int row) const { return std::min((first_row_ + row) * size_, grid_.height); }
  std::size_t node(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_ + 1) + static_cast<std::size_t>(column);
  }

  const HeadView& head_;
  HeadPicture::Moved moved_;
  bands::Grid grid_;
  bands::Window window_;
  int size_;                              ///< side of a cell, px
  int around_;                            ///< cells of the whole circle
  int first_column_ = 0, first_row_ = 0;  ///< the first cell of the window
  int columns_ = 0, rows_ = 0;            ///< its cells
  std::vector<std::optional<Sighting>> nodes_;
  std::vector<Cell> cells_;
};

}  // namespace nodal::offline
