// Two bands: seams as sharp as they are for detail, and wide transitions for low frequencies, such as the brightness of
// a sky that two heads show differently. Internal to stitch/blend.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "stitch/blend/blend_job.h"

namespace nodal::blend {

/// Corrections of the heads' light in one block of tiles, computed from low pictures (prepare.h), block by block.
///
/// At each point of GridTable::low, every head's light is that of its low picture, bilinear between samples: by curve
/// and gain as in blend.h, negative. The confidence in it is the least that the head has in the darkest and the
/// brightest level of the four samples. `mean` is the weighted mean of the heads that are there, their weights
/// multiplied by the confidence. A head's correction at the point is mean - light, clamped to kMaxCorrection, times
/// confidence / kSure, rounded towards 0: what is clipped tells nothing about the rest of a square. In a cell, it is
/// bilinear between the four corners; a corner that the head does not see counts as the mean of those that it sees, and
/// as 0 if it sees none. So with l the light of a head, low(l) that of its low picture, and w_narrow and w_wide the
/// weights of both transitions, the raymap is
///
///   sum of w_narrow (l + up(mean - low(l))),   mean = sum of w_wide low(l)
///
/// Threading: thread-bound. Ownership: keeps the job by reference. Errors: none.
class LowBand {
 public:
  /// Light is in 1/128 of a level; so four times any correction fits 16 bits, even after rounding.
  static constexpr int kMaxCorrection = 8160;
  /// mulr(coefficient, kUnit) of a coefficient of coefficients() is in the unit of light.
  static constexpr int kUnit = 1 << 13;

  static constexpr std::int64_t kSure = 255;  ///< confidence without doubt

  static constexpr std::size_t kTogether = 64;  ///< sights whose light is computed together

  explicit LowBand(const BlendJob& job);

  /// Computes the corrections of a block.
  void begin_block(std::size_t block);
  /// The tile (column, row) of the block is next.
  void begin_tile(int column, int row) {
    const int cell = (row >> cell_bits_) * grid_.low_cells_across() + (column >> cell_bits_);
    const int part = (row & cell_bits_) * 2 + (column & cell_bits_);
    tile_ = static_cast<std::size_t>(part) * cell_count_ + static_cast<std::size_t>(cell);
  }
  /// Whether the head's correction is not 0 everywhere in the tile.
  bool corrects(HeadIndex head) const { return (corrected_[head] >> tile_ & 1) != 0; }
  /// If so, coefficients of 1, i, j, ij: its correction in the tile, negative light, in 1/4 of the unit of light.
  const std::int16_t* coefficients(HeadIndex head, std::size_t c) const { return coefficients_[head][c][tile_].data(); }

 private:
  static constexpr std::int16_t kUnseen = -32768;
  static constexpr std::size_t kNoBlock = ~std::size_t{0};
  static constexpr std::size_t kMaxSights = GridTable::kMaxLowPoints * kMaxHeads;  ///< per block
  /// Numbers of the block's sights, one after another; with room for whole registers.
  template <class Number>
  using OfSights = std::array<Number, kMaxSights + kTogether>;
  using Corrections = std::array<std::int16_t, GridTable::kMaxLowPoints>;

  void locate(std::size_t block);
  void look_at_sights(std::size_t first, std::size_t count);
  void correct(std::size_t first, std::size_t count, std::size_t points);
  void correct_carefully(std::size_t point);
  std::uint32_t heads_of(std::size_t block) const;
  void compute(HeadIndex head);
  std::int16_t negative_light(const LowSight& sight, std::size_t c) const;
  std::uint32_t confidence(const LowSight& sight) const;

  /// A head's low picture.
  struct Place {
    std::array<const std::uint8_t*, kMaxPlanes> data{};  ///< by component of the grid
    std::ptrdiff_t row_stride = 0;
  };
  /// What the light of kTogether sights is computed from. `above` and `below`: a sample and the one to its right.
  struct Looks {
    std::array<std::array<std::uint64_t, kTogether>, kMaxPlanes> above;
    std::array<std::array<std::uint64_t, kTogether>, kMaxPlanes> below;
    std::array<std::uint16_t, kTogether> x;
    std::array<std::uint16_t, kTogether> y;
    std::array<std::int16_t, kTogether> own_gain;  ///< LowSight::gain
    std::array<std::array<std::int16_t, kTogether>, kMaxPlanes> head_gain;
  };

  const BlendJob& job_;
  const GridTable& grid_;
  const std::size_t components_;
  const int cell_bits_;  ///< a cell is 1 << cell_bits_ tiles wide
  std::array<Place, kMaxHeads> low_;
  std::size_t first_point_ = 0;
  const std::size_t cell_count_;                        ///< number of cells per block
  const std::array<std::uint8_t, 4>* cells_ = nullptr;  ///< the current block's cells
  std::size_t tile_ = 0;                                ///< the tile's place in a head's coefficients
  std::array<std::uint64_t, kMaxHeads> corrected_;      ///< one bit for each tile with a correction that is not 0
  std::size_t located_ = kNoBlock;                      ///< the block that offset_ is of
  Looks looks_{};
  OfSights<std::int32_t> offset_;                         ///< where a low picture's plane has the sight's first sample
  OfSights<std::uint8_t> point_;                          ///< place in the block
  std::array<OfSights<std::int16_t>, kMaxPlanes> light_;  ///< negative, by component
  std::array<std::array<Corrections, kMaxPlanes>, kMaxHeads> at_;
  /// Coefficients of the upper left tiles of all cells, cell by cell; with cells of several tiles then those of the
  /// upper right, the lower left and the lower right ones.
  using Coefficients = std::array<std::array<std::int16_t, 4>, GridTable::kBlockTiles * GridTable::kBlockTiles>;
  std::array<std::array<Coefficients, kMaxPlanes>, kMaxHeads> coefficients_;
};

}  // namespace nodal::blend
