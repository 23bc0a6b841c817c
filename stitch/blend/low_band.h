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
/// At each point of GridTable::low, every head's light is that of its low picture, bilinear between samples: by curve and
/// gain as in blend.h, negative. The confidence in it is the least that the head has in the darkest and the brightest level
/// of the four samples. `mean` is the weighted mean of the heads that are there, their weights multiplied by the
/// confidence. A head's correction at the point is mean - light, clamped to kMaxCorrection, times confidence / kSure,
/// rounded towards 0: what is clipped tells nothing about the rest of a square. In a cell, it is
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
  /// Of coefficients(), relative to the unit of light: what mulr() makes of it.
  static constexpr int kUnit = 1 << 13;

  static constexpr std::int64_t kSure = 255;  ///< confidence without doubt

  explicit LowBand(const BlendJob& job);

  /// Computes the corrections at the points of a block.
  void begin_block(std::size_t block);
  /// The tile (column, row) of the block is next.
  void begin_tile(int column, int row);
  /// For each component, coefficients of 1, i, j, ij: the head's correction in the tile, negative light, in 1/4 of the
  /// unit of light. Null if the head is not corrected there.
  const std::int16_t* coefficients(HeadIndex head);

 private:
  using Corrections = std::array<std::int16_t, GridTable::kMostLowPoints>;
  static constexpr std::int16_t kUnseen = -32768;

  void correct(std::size_t point);
  void compute(HeadIndex head);
  static void fill_unseen(std::array<int, 4>& corners);
  std::int16_t negative_light(const LowSight& sight, std::size_t c) const;
  std::uint32_t confidence(const LowSight& sight) const;

  const BlendJob& job_;
  const GridTable& grid_;
  std::size_t first_point_ = 0;
  const std::array<std::uint8_t, 4>* cells_ = nullptr;  ///< of the block
  const std::uint8_t* corners_ = nullptr;               ///< of the tile's cell
  int quadrant_x_ = 0;                                  ///< of the tile in its cell
  int quadrant_y_ = 0;
  std::uint32_t seen_ = 0;  ///< heads that see a point of the block, one bit each
  std::uint32_t done_ = 0;  ///< heads whose coefficients in the tile are computed
  std::uint32_t moved_ = 0;
  std::array<std::array<Corrections, kMaxPlanes>, kMaxHeads> at_;
  std::array<std::array<std::int16_t, 4 * kMaxPlanes>, kMaxHeads> coefficients_;
};

}  // namespace nodal::blend
