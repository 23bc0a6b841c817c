// The blend table. For every 8x8 tile of the raymap and every head that sees it: which 16x16 samples of the head the
// tile reads, each pixel's coordinates within them, and its weight. stitch/table makes it from a calibration and a
// layout, and validates it before use. Integers only.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/units.h"

namespace nodal::blend {

inline constexpr int kTile = 8;  ///< pixels per side of a tile
inline constexpr int kTilePixels = kTile * kTile;
inline constexpr int kPatch = 16;         ///< samples per side of a patch
inline constexpr int kQuarter = 4;        ///< pixels per side of a quarter of a tile
inline constexpr int kMinSpan = 6;        ///< patch rows that suffice for nearly every quarter
inline constexpr int kFractionBits = 12;  ///< fraction bits of a coordinate in a patch; it has four integer bits
inline constexpr int kWeightBits = 15;    ///< weights of a covered pixel sum to exactly one, 1 << kWeightBits
inline constexpr int kGainBits = 12;      ///< fraction bits of Source::gain
inline constexpr int kMaxGain = 32767;    ///< largest Source::gain: just below 8
inline constexpr int kSharpenBits = 6;    ///< Source::sharpen is in 1 / (1 << kSharpenBits)
inline constexpr int kMaxSharpen = 16;
inline constexpr int kSharpenReach = 2;  ///< distance in samples of the neighbours that Source::sharpen subtracts
inline constexpr std::size_t kLinearSteps = 1 << 15;  ///< entries of BlendTable::linear
inline constexpr int kMaxLevels = 5;                  ///< levels of a head's pyramid: 1, 1/2, .. 1/16
inline constexpr int kMaxPictures = kMaxLevels + 1;   ///< and its low picture
inline constexpr int kMinLowSize = 16;
inline constexpr int kMaxLowSize = 256;

/// Coefficients of 1, i, j, ij, ii, jj over the pixels (i, j) of a tile, 0 .. 7 each.
using Quadratic = std::array<std::int16_t, 6>;

/// A constant coefficient after the patch has been moved by so many samples.
inline std::int16_t moved(std::int16_t coefficient, int samples) {
  return static_cast<std::int16_t>(static_cast<std::uint16_t>(coefficient - samples * (1 << kFractionBits)));
}

/// What one head contributes to one tile. Pixel (i, j) has the patch coordinates x(i, j), y(i, j), modulo 2^16, in
/// 1 / (1 << kFractionBits) samples. For pixels with weight both are below 15, so that the next sample is in the patch
/// too. The record is two halves of 16 bytes with the same layout, one for x and one for y.
///
/// Where one patch does not hold the samples of a tile, but one for each half of it does, the head has a pair of
/// records: that of the upper four rows, followed by that of the lower four rows. They have one weight between them,
/// and one list, or one polynomial: that of the second record is the first one's, moved() by the distance between the
/// patches.
struct PatchRecord {
  Quadratic x{};
  std::uint16_t left = 0;  ///< first column and row of the patch in the plane of the record's level
  std::uint16_t top = 0;
  Quadratic y{};
  /// Bits 0-3: the head. Bits 4-6: the pyramid level, 0 .. kMaxLevels - 1. Bit 7, kListed: the pixels' coordinates are
  /// in GridTable::coordinates, and x[0], x[1] are the number of their list, low half first.
  std::uint8_t source = 0;
  /// Bits 0-3: the last patch row that is the upper sample row of a pixel with weight. Bits 4-7: how many consecutive
  /// such rows a quarter of the tile needs at most, at least kMinSpan.
  std::uint8_t rows = 14 | 15 << 4;
  /// The patch row from which each quarter is read (its first such row, or an earlier one), for the upper and the lower
  /// half of the tile. Bits 0-3: left quarter; bits 4-7: right quarter. A pixel also reads the row below its upper one.
  /// kOther for the half of the tile that the other record of a pair has.
  std::array<std::uint8_t, 2> first{};

  static constexpr std::uint8_t kListed = 0x80;
  static constexpr std::uint8_t kOther = 0xff;
  static constexpr std::uint8_t source_of(HeadIndex head, int level, bool listed) {
    return static_cast<std::uint8_t>(head | level << 4 | (listed ? kListed : 0));
  }
  bool listed() const { return (source & kListed) != 0; }
  int pyramid_level() const { return source >> 4 & 7; }
  HeadIndex head() const { return source & 15; }
  /// Whether the record has this half of the tile, 0 (upper) or 1 (lower).
  bool has(std::size_t half) const { return first[half] != kOther; }
  /// Whether the record is the first of a pair.
  bool paired() const { return !has(1); }
  int last_row() const { return rows & 15; }
  int span() const { return rows >> 4; }
  /// First row of the quarter `side` (0: left, 1: right) of half 0 (upper) or 1 (lower).
  int first_row(std::size_t half, std::size_t side) const { return first[half] >> (4 * side) & 15; }
  int first_row(std::size_t half) const { return std::min(first_row(half, 0), first_row(half, 1)); }
  std::size_t list() const {
    return static_cast<std::uint16_t>(x[0]) | std::size_t{static_cast<std::uint16_t>(x[1])} << 16;
  }
  void set_list(std::size_t number) {
    x[0] = static_cast<std::int16_t>(static_cast<std::uint16_t>(number & 0xffff));
    x[1] = static_cast<std::int16_t>(static_cast<std::uint16_t>(number >> 16));
  }
  friend bool operator==(const PatchRecord&, const PatchRecord&) = default;
};
static_assert(sizeof(PatchRecord) == 32);

/// How a tile's records share its pixels; a pair counts as one record. Weights are stored negative: a weight of one,
/// -(1 << 15), then fits 16 bits.
enum class Sharing : std::uint8_t {
  kAlone,     ///< at most one record; if there is one, its weight is one at every pixel
  kBilinear,  ///< coefficients of 1, i, j, ij per record; the last record has none and gets one minus the others
  kListed,    ///< 64 weights per record, row by row; the last record has none and gets one minus the others
  kOpen,      ///< 64 weights for every record; they sum to one, or to zero where no head sees the pixel
};

/// How many weights a tile with these records has to share out: a pair has one.
inline std::size_t share_count(std::span<const PatchRecord> records) {
  return records.size() - static_cast<std::size_t>(std::ranges::count_if(records, &PatchRecord::paired));
}

/// The tile's records are those from `record` up to the next tile's `record`. Tiles are stored in the order in which
/// they are blended, see GridTable::tile_index.
struct Tile {
  std::uint32_t record = 0;
  std::uint32_t sharing = 0;  ///< Sharing in bits 30-31; below, a quarter of the index into GridTable::weights

  Sharing how() const { return static_cast<Sharing>(sharing >> 30); }
  std::size_t weights() const { return std::size_t{sharing & 0x3fffffffU} * 4; }
  friend bool operator==(const Tile&, const Tile&) = default;
};

/// What one head shows at one point of a LowGrid.
struct LowSight {
  std::uint16_t x = 0;  ///< column in the head's low picture, in 1/256 of its samples
  std::uint16_t y = 0;
  std::uint16_t weight = 0;  ///< weight in 1 / (1 << kWeightBits); the weights of a point sum to exactly one
  std::int16_t gain = 0;     ///< undoes vignetting, as GridTable::gains; 0 if there is none to undo
  HeadIndex head = 0;
  friend bool operator==(const LowSight&, const LowSight&) = default;
};

/// Two bands (low_band.h): the points at which the light of the heads' low pictures is compared. They are the corners
/// of square cells of a block's tiles. Cells share a corner where their rays there are the same.
struct LowGrid {
  int cell_tiles = 2;                      ///< side of a cell in tiles, 1 or 2
  std::vector<std::uint32_t> first_point;  ///< number of each block's first point, and the end
  std::vector<std::uint32_t> first_sight;  ///< index of each point's first sight, and the end
  std::vector<LowSight> sights;
  /// Corners of every block's cells, row by row: upper left, upper right, lower left and lower right, as numbers of
  /// points of the block.
  std::vector<std::array<std::uint8_t, 4>> cells;
};

/// The tiles of one sample grid of the raymap.
struct GridTable {
  static constexpr int kBlockTiles = 8;  ///< tiles are blended in blocks of this many columns and block_rows() rows

  int width = 0;
  int height = 0;
  int row_step = 1;         ///< raymap rows per row of this grid: 1, or 2 for I420 chroma
  std::vector<Tile> tiles;  ///< tile_count() tiles, and one more that ends the last tile's records
  std::vector<PatchRecord> records;
  std::vector<std::int16_t> weights;
  std::vector<std::uint16_t> coordinates;  ///< lists of 64 x, then 64 y, row by row
  /// Per record, coefficients of 1, i, j, ij: the gain that undoes vignetting, in 1 / (1 << 15) of
  /// BlendTable::vignetting_scale, 1 .. 32767 for pixels with weight. Empty if there is no vignetting to undo.
  std::vector<std::array<std::int16_t, 4>> gains;

  /// Only for raymaps whose rays were sorted into tiles: each pixel's position in the component's plane, see place();
  /// 64 per tile, row by row; kNowhere outside the grid. Empty if pixels are where their tiles are.
  std::vector<std::uint32_t> places;
  static constexpr std::uint32_t kNowhere = 0xffffffff;
  static constexpr std::uint32_t place(int x, int y) {
    return static_cast<std::uint32_t>(y) << 16 | static_cast<std::uint32_t>(x);
  }

  /// Only with `places`, and only where that is faster: a batch of strips, of kBlockTiles tiles each, is blended into a
  /// buffer. Its pixels are then written in runs. Without batches, each pixel is written on its own.
  struct Batch {
    std::uint32_t strip = 0;  ///< its first tile is strip * kBlockTiles
    std::uint32_t run = 0;    ///< its first run
  };
  /// Pixels side by side in one row of the component's plane.
  struct Run {
    std::uint32_t place = 0;  ///< place() of its first pixel
    std::uint32_t slot = 0;   ///< index in `slots` of its first pixel
  };
  std::vector<Batch> batches;  ///< and one more, which ends the last; empty: no batches
  std::vector<Run> runs;       ///< and one more, which ends the last
  /// Where the buffer holds the runs' pixels, from left to right; see slot().
  std::vector<std::uint16_t> slots;
  static constexpr std::size_t kBufferSlots = 1 << 16;
  /// Where the buffer holds the first component of pixel p of tile k of the batch's strip s.
  static constexpr std::size_t slot(std::size_t s, std::size_t k, std::size_t p, std::size_t components) {
    return (s * components * kBlockTiles + k) * kTilePixels + p;
  }
  static constexpr std::size_t most_strips(std::size_t components) { return kBufferSlots / slot(1, 0, 0, components); }

  LowGrid low;                                       ///< empty: one band
  static constexpr std::size_t kMaxLowPoints = 128;  ///< per block
  int low_cells_across() const { return kBlockTiles / low.cell_tiles; }
  int low_cells_down() const { return block_rows() / low.cell_tiles; }

  /// Rounded up to whole blocks, which may extend beyond the grid; tiles outside the grid have no records.
  int tiles_across() const { return (width + 8 * kTile - 1) / (8 * kTile) * 8; }
  /// Height of a block in tiles: as many as cover 64 raymap rows.
  int block_rows() const { return 8 / row_step; }
  int tiles_down() const { return (height + block_rows() * kTile - 1) / (block_rows() * kTile) * block_rows(); }
  std::size_t tile_count() const {
    return static_cast<std::size_t>(tiles_across()) * static_cast<std::size_t>(tiles_down());
  }
  std::size_t block_count() const { return tile_count() / static_cast<std::size_t>(kBlockTiles * block_rows()); }
  /// The index of the tile whose first pixel is (8 column, 8 row). Tiles are ordered block by block, and row by row
  /// within a block, so that the samples that neighbouring tiles share are still in the cache.
  std::size_t tile_index(int column, int row) const {
    const int block = row / block_rows() * (tiles_across() / kBlockTiles) + column / kBlockTiles;
    return (static_cast<std::size_t>(block) * static_cast<std::size_t>(block_rows()) +
            static_cast<std::size_t>(row % block_rows())) *
               kBlockTiles +
           static_cast<std::size_t>(column % kBlockTiles);
  }
};

/// Rows of a halved picture (pyramid levels from 1 on) are made in bands of so many, or are not made.
inline constexpr int kMadeRows = 8;

/// How to blend one component: gains scale its distance from `black`, and pixels that no head covers are black.
struct ComponentRule {
  std::uint8_t grid = 0;   ///< index into BlendTable::grids
  std::uint8_t black = 0;  ///< the value that means no light: 0 for R G B Y (full range), 128 for U V
  std::uint8_t tone = 0;   ///< its class, see tone.h: 0 1 2 for R G B, 0 for Y and GREY, 1 for U and V
  friend bool operator==(const ComponentRule&, const ComponentRule&) = default;
};

/// Everything that the blend of one raymap needs. Immutable once validated.
struct BlendTable {
  PixelFormat format = PixelFormat::kI420;  ///< format of the raymap: I420, NV12, RGB24, GREY, RGB48 or GREY16
  int width = 0;                            ///< width of the raymap, px
  int height = 0;
  struct Source {
    PixelFormat format = PixelFormat::kI420;
    int width = 0;
    int height = 0;
    /// Undoes the head's own gain when its exposure is the calibrated one; by tone class, 1 .. kMaxGain.
    std::array<std::uint16_t, 3> gain{1 << kGainBits, 1 << kGainBits, 1 << kGainBits};
    /// The share, in 1 / (1 << kSharpenBits), of a sample's difference from each of its four neighbours kSharpenReach
    /// away that is added to it; restores the detail that bilinear interpolation loses. 0 .. kMaxSharpen. Levels above
    /// 0 are made of unsharpened samples, so it is 0 where records use only those.
    std::uint8_t sharpen = 0;
    /// Pyramid levels that this head's records use; 1: only the picture itself.
    std::uint8_t levels = 1;
    /// Two bands: side of the squares of which the head's low picture has one sample each (low_picture.h), in samples
    /// of the picture: a power of two, kMinLowSize .. kMaxLowSize. 0: there is no low picture.
    std::uint16_t low_size = 0;
    /// The head's entries in Pictures: its levels, then its low picture.
    std::size_t pictures() const { return std::size_t{levels} + (low_size != 0 ? 1 : 0); }
    /// Which field of the head's frames the picture is; `height` is then the field's height. Nothing: a whole frame.
    std::optional<FieldParity> field = std::nullopt;
    /// By grid and level - 1: whether each band of kMadeRows rows of the level is made. Nothing is read from the
    /// others. Empty: all are.
    std::array<std::array<std::vector<bool>, kMaxLevels - 1>, 2> made{};
  };
  std::vector<Source> sources;   ///< format, size and preparation of each head's picture, by head index
  std::vector<GridTable> grids;  ///< full resolution first, then chroma if it is subsampled
  /// What replaces a head that is missing or not trusted, where `grids` show only the best head of each pixel: for
  /// every grid, the tiles of a blend of all heads, in the same order (places are the grid's own). A tile that only one
  /// head sees has no records here. Empty if `grids` blend all heads.
  std::vector<GridTable> cover;
  std::array<ComponentRule, kMaxPlanes> components{};
  /// What a GridTable::gains value of one (1 << 15) stands for, in 1/256; 256 .. 2048.
  std::uint16_t vignetting_scale = 256;
  /// Only for 16-bit raymaps: the number that is written for each light 0 .. 2^15 - 1, rising from 0 for no light to
  /// 65535 for kMaxSample.
  std::vector<std::uint16_t> linear;
};

}  // namespace nodal::blend
