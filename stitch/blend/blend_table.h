// The blend table: for every 8x8 tile of the raymap and every head that looks there, which 16x16 samples of the head
// hold what the tile needs, where in them each pixel lies, and how much of it to take. Made by stitch/table from a
// calibration and a layout, proven there, and only then run. Integers only.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/units.h"

namespace nodal::blend {

inline constexpr int kTile = 8;  ///< pixels a side of a tile
inline constexpr int kTilePixels = kTile * kTile;
inline constexpr int kPatch = 16;         ///< samples a side of a patch
inline constexpr int kQuarter = 4;        ///< pixels a side of a quarter of a tile
inline constexpr int kLeastSpan = 6;      ///< patch rows that nearly every quarter finds its pixels in
inline constexpr int kFractionBits = 12;  ///< of a coordinate in a patch, which has four bits before the point
inline constexpr int kWeightBits = 15;    ///< weights of a covered pixel sum to exactly one, 1 << kWeightBits
inline constexpr int kGainBits = 12;      ///< of Source::gain
inline constexpr int kMaxGain = 32767;    ///< of Source::gain: just below 8
inline constexpr int kSharpenBits = 6;    ///< Source::sharpen is in 1 / (1 << kSharpenBits)
inline constexpr int kMaxSharpen = 16;
inline constexpr int kSharpenReach = 2;  ///< samples to the neighbours that Source::sharpen takes away from
inline constexpr std::size_t kLinearSteps = 1 << 15;  ///< of BlendTable::linear
inline constexpr int kMaxLevels = 5;                  ///< of a head's pyramid: 1, 1/2, .. 1/16

/// Coefficients of 1, i, j, ij, ii, jj over the pixels (i, j) of a tile, 0 .. 7 each.
using Quadratic = std::array<std::int16_t, 6>;

/// What one head gives to one tile. Pixel (i, j) lies at x(i, j), y(i, j) in the patch, modulo 2^16, in
/// 1 / (1 << kFractionBits) samples; of pixels with weight both are below 15, so that the next sample is there too.
/// Two halves of 16 bytes, alike for x and y.
struct PatchRecord {
  Quadratic x{};
  std::uint16_t left = 0;  ///< of the patch in the plane of the record's level
  std::uint16_t top = 0;
  Quadratic y{};
  /// The head, 0 .. 15, and above it the pyramid's level, 0 .. kMaxLevels - 1. With kListed the pixels' coordinates are
  /// listed in GridTable::coordinates and x[0], x[1] are the list's number, low half first.
  std::uint8_t source = 0;
  /// Of the patch's rows in which pixels with weight begin: the last one of all, and above it how many in a row those of
  /// any quarter of the tile are, at least kLeastSpan.
  std::uint8_t rows = 14 | 15 << 4;
  /// Where those of each quarter start, by upper and lower half of the tile: the left quarter's row, and above it the
  /// right one's. Each pixel also needs the row after the one it begins in; with that all are in the patch.
  std::array<std::uint8_t, 2> first{};

  static constexpr std::uint8_t kListed = 0x80;
  static constexpr std::uint8_t source_of(HeadIndex head, int level, bool listed) {
    return static_cast<std::uint8_t>(head | level << 4 | (listed ? kListed : 0));
  }
  bool listed() const { return (source & kListed) != 0; }
  int pyramid_level() const { return source >> 4 & 7; }
  HeadIndex head() const { return source & 15; }
  int last_row() const { return rows & 15; }
  int span() const { return rows >> 4; }
  /// Of quarter `side`, 0 the left one, of half 0 or 1.
  int first_row(std::size_t half, std::size_t side) const { return first[half] >> (4 * side) & 15; }
  int first_row(std::size_t half) const { return std::min(first_row(half, 0), first_row(half, 1)); }
  std::size_t list() const {
    return static_cast<std::uint16_t>(x[0]) | std::size_t{static_cast<std::uint16_t>(x[1])} << 16;
  }
  friend bool operator==(const PatchRecord&, const PatchRecord&) = default;
};
static_assert(sizeof(PatchRecord) == 32);

/// How a tile's records share its pixels. Weights are kept negative, for one is then a 16-bit number: -(1 << 15).
enum class Sharing : std::uint8_t {
  kAlone,     ///< at most one record; with one, every pixel is all its
  kBilinear,  ///< four coefficients (1, i, j, ij) a record; the last has none, and gets what the others leave of one
  kListed,    ///< 64 weights a record, row by row; the last has none, and gets what the others leave of one
  kOpen,      ///< 64 weights for every record; they sum to one, or to nothing where nobody looks
};

/// Records of a tile: from `record` up to the next tile's. Tiles are kept in the order they are made, see
/// GridTable::tile_index.
struct Tile {
  std::uint32_t record = 0;
  std::uint32_t sharing = 0;  ///< Sharing in the upper two bits; below, a quarter of the index into GridTable::weights

  Sharing how() const { return static_cast<Sharing>(sharing >> 30); }
  std::size_t weights() const { return std::size_t{sharing & 0x3fffffffU} * 4; }
  friend bool operator==(const Tile&, const Tile&) = default;
};

/// The tiles of one sample grid of the raymap.
struct GridTable {
  static constexpr int kBlockTiles = 8;  ///< tiles are made in blocks of this many by block_rows

  int width = 0;
  int height = 0;
  int row_step = 1;         ///< raymap rows to a row of this grid: 1, or 2 for I420 chroma
  std::vector<Tile> tiles;  ///< tile_count() of them, and one for the end of the last
  std::vector<PatchRecord> records;
  std::vector<std::int16_t> weights;
  std::vector<std::uint16_t> coordinates;  ///< lists of 64 x, then 64 y, row by row
  /// By record, coefficients of 1, i, j, ij: undoes the vignetting, in 1 / (1 << 15) of BlendTable::vignetting_scale,
  /// 1 .. 32767 for pixels with weight. Empty where there is none to undo.
  std::vector<std::array<std::int16_t, 4>> gains;

  /// Of raymaps whose rays were sorted into tiles: where in the component's plane each pixel of a tile is written, see
  /// place(), 64 a tile, row by row; kNowhere beyond the grid. Empty where pixels lie where their tiles do.
  std::vector<std::uint32_t> places;
  static constexpr std::uint32_t kNowhere = 0xffffffff;
  static constexpr std::uint32_t place(int x, int y) {
    return static_cast<std::uint32_t>(y) << 16 | static_cast<std::uint32_t>(x);
  }

  /// Whole blocks, which may reach beyond the grid; tiles outside it have no records.
  int tiles_across() const { return (width + 8 * kTile - 1) / (8 * kTile) * 8; }
  /// Of a block: as many as 64 raymap rows hold.
  int block_rows() const { return 8 / row_step; }
  int tiles_down() const { return (height + block_rows() * kTile - 1) / (block_rows() * kTile) * block_rows(); }
  std::size_t tile_count() const {
    return static_cast<std::size_t>(tiles_across()) * static_cast<std::size_t>(tiles_down());
  }
  /// Of the tile whose first pixel is (8 column, 8 row): block by block, in rows within the block, so that what
  /// neighbouring tiles read is still at hand.
  std::size_t tile_index(int column, int row) const {
    const int block = row / block_rows() * (tiles_across() / kBlockTiles) + column / kBlockTiles;
    return (static_cast<std::size_t>(block) * static_cast<std::size_t>(block_rows()) +
            static_cast<std::size_t>(row % block_rows())) *
               kBlockTiles +
           static_cast<std::size_t>(column % kBlockTiles);
  }
};

/// What a component is made of, so that gains act on light and uncovered pixels are black.
struct ComponentRule {
  std::uint8_t grid = 0;   ///< index into BlendTable::grids
  std::uint8_t black = 0;  ///< the value that means no light: 0 for R G B Y (full range), 128 for U V
  std::uint8_t tone = 0;   ///< its class, see tone.h: 0 1 2 for R G B, 0 for Y and GREY, 1 for U and V
  friend bool operator==(const ComponentRule&, const ComponentRule&) = default;
};

/// A raymap's blend, whole. Immutable once validated.
struct BlendTable {
  PixelFormat format = PixelFormat::kI420;  ///< of the raymap: I420, NV12, RGB24, GREY, RGB48 or GREY16
  int width = 0;                            ///< of the raymap, px
  int height = 0;
  struct Source {
    PixelFormat format = PixelFormat::kI420;
    int width = 0;
    int height = 0;
    /// Undoes the head's own gain when it is exposed as it was calibrated, by tone class, 1 .. kMaxGain.
    std::array<std::uint16_t, 3> gain{1 << kGainBits, 1 << kGainBits, 1 << kGainBits};
    /// How much of a sample's difference from each of four others, kSharpenReach to its sides, is added to it before it is mixed, 0 ..
    /// kMaxSharpen: gives back what mixing four samples takes from fine detail. 0 leaves samples as they are, as does
    /// whoever makes smaller levels of them; so it is 0 where records name only those.
    std::uint8_t sharpen = 0;
    /// Pyramid levels that records of this head name: 1 where the picture itself is all.
    std::uint8_t levels = 1;
    /// Which field of the head's frames the picture is; `height` is then the field's. Nothing: a whole frame.
    std::optional<FieldParity> field = std::nullopt;
  };
  std::vector<Source> sources;   ///< what the blend must be given of each head, by head index
  std::vector<GridTable> grids;  ///< full resolution first, then chroma where it has its own
  std::array<ComponentRule, kMaxPlanes> components{};
  /// What GridTable::gains are relative to, in 1/256, 256 .. 2048.
  std::uint16_t vignetting_scale = 256;
  /// Of raymaps of 16 bits, the number that each light 0 .. 2^15 - 1 is written as, rising from 0 for no light to 65535
  /// for kMaxSample; empty for others.
  std::vector<std::uint16_t> linear;
};

}  // namespace nodal::blend
