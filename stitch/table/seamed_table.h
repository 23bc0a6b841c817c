// Seams that can be moved while the rig films: a small map of the sphere determines where a table's seams are.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stitch/blend/blend_table.h"

namespace nodal::geometry {
class RaymapLayout;
}

namespace nodal::table {

/// Makes tables with other seams out of a compiled table. Its cover has, for every tile that several heads see, each
/// head's patches; so a tile's new weights need no lens and no floating point, and nothing is read that the table's
/// proof did not cover. Tiles that one head sees are copied.
///
/// Labels name the head that shows each pixel of an equirectangular map, row by row; kNoHead: any that sees it. Those
/// around a place are weighted by a quadratic B-spline, which makes the map's steps a smooth line. With s the share of
/// a head, S the largest one and D that of a ramp's half width, the head's weight is (1 - x) / (1 + x), x = (S - s) /
/// D, and 0 from x = 1 on: as in seam.h. A head counts only at pixels at which the cover has a weight for it; where no
/// head of the labels around has one, the head with the largest weight of the cover shows the pixel.
///
/// Threading: immutable; any thread. Memory: 4 bytes a pixel of the tiles that several heads see.
class SeamedTable {
 public:
  static constexpr std::uint8_t kNoHead = 255;
  static constexpr int kMaxColumns = 512;
  using Labels = std::span<const std::uint8_t>;

  /// `table` has a cover and is for `layout`. The map has `map_width` columns and half as many rows. `seam_width_deg`:
  /// TableOptions's, up to 1.3 pixels of the map.
  SeamedTable(const blend::BlendTable& table, const geometry::RaymapLayout& layout, int map_width,
              double seam_width_deg);

  struct Moved {
    blend::BlendTable table;
    std::vector<std::vector<bool>> made;  ///< by grid and tile: whether it was made anew, not copied
  };
  /// `table`: the one that this object was made for (`before` is empty), or one that it made with the labels `before`.
  /// Only tiles near changed labels are made anew.
  Moved with(const blend::BlendTable& table, Labels before, Labels labels) const;

 private:
  static constexpr std::uint32_t kOneHead = 0xffffffff;
  struct Grid {
    std::vector<std::uint32_t> first;   ///< index of each tile's 64 places; kOneHead: only one head sees the tile
    std::vector<std::uint32_t> places;  ///< on the map, in 1/128 px: column, and row << 16; kNowhere outside the grid
    std::vector<std::uint64_t> seen;    ///< by record of the cover: the pixels for which it has weight, bit 8 j + i
  };
  blend::GridTable with(const blend::GridTable& own, const blend::GridTable& cover, const Grid& grid, Labels labels,
                        const std::vector<std::uint8_t>& around, const std::vector<bool>& made) const;

  int map_width_;
  std::vector<Grid> grids_;
  std::int64_t ramp_ = 1;  ///< D, in 1 / kWholeShare
};

}  // namespace nodal::table
