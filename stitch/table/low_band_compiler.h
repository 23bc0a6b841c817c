// For two bands: where the heads' low pictures are compared, and with which weights.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "stitch/blend/blend_table.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::table {

/// BlendTable::Source::low_size of each head: about 16 pixels of the raymap, and at least kMinLowSize.
std::vector<std::uint16_t> low_sizes(const RaySampler& sampler);

/// Compiles one row of blocks of a grid at a time.
///
/// A head has a sight at a point if its low picture's samples around it lie inside its region. Its weight is that of a
/// feather (TableOptions::feather) that begins there.
///
/// Threading: thread-bound; one a thread.
/// Ownership: keeps its arguments by reference.
class LowBandCompiler {
 public:
  /// `wide` is made with Transition::kFeather. `shape` has the grid's size, and no tiles. places: GridTable::places of
  /// layouts whose rays are sorted into tiles, else empty. vignetting_scale: BlendTable's; 0 where no vignetting is
  /// undone.
  LowBandCompiler(const RaySampler& wide, int grid, const blend::GridTable& shape,
                  std::span<const std::uint32_t> places, std::span<const std::uint16_t> sizes, int vignetting_scale);

  /// Row `block_row` of blocks: first_point and first_sight begin with 0 and end with the totals.
  blend::LowGrid compile(int block_row);

 private:
  struct Cell {
    std::array<std::optional<geometry::Ray>, 4> corners;
  };
  Cell cell_at(int column, int row) const;
  Cell cell_of_sorted_rays(int column, int row) const;
  void add_block(int block_column, int block_row, blend::LowGrid& low);
  void add_sights(std::span<const RaySample> seen, blend::LowGrid& low) const;

  const RaySampler& wide_;
  const int grid_;
  blend::GridTable shape_;  ///< without tiles
  std::span<const std::uint32_t> places_;
  std::span<const std::uint16_t> sizes_;
  const int vignetting_scale_;
  RowSampler sampler_;
};

/// Appends a row of blocks to those before it.
void append(const blend::LowGrid& row, blend::LowGrid& low);

}  // namespace nodal::table
