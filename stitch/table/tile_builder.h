// Makes the tiles of a table: the patches that a tile reads, and their weights.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "stitch/blend/blend_table.h"
#include "stitch/table/clear_tile.h"
#include "stitch/table/ray_sampler.h"
#include "stitch/table/tile_fit.h"

namespace nodal::table {

/// Consecutive tiles with their records, weights, lists and gains; indices are relative to the run.
struct TileRun {
  std::vector<blend::Tile> tiles;  ///< Tile::record is the index of the tile's first record
  std::vector<blend::PatchRecord> records;
  std::vector<std::int16_t> weights;
  std::vector<std::uint16_t> coordinates;
  std::vector<std::array<std::int16_t, 4>> gains;
};

/// The sources of 64 pixels. Pixels that are not in `inside` are outside the raymap and ignored.
struct TileSamples {
  std::array<std::vector<RaySample>, blend::kTilePixels> at;  ///< 8 j + i
  PixelMask inside = 0;
};

/// Appends tiles of one grid to a run. A head contributes one patch to a tile. Its coordinates are a quadratic if that
/// is within kPatchFit of every pixel's coordinates, else they are listed. If the pixels do not fit into one patch, or
/// a bilinear function does not fit the vignetting gains, the tile is divided: at an edge of the layout, else into a
/// pair of its upper and its lower half, else, recursively, in halves, with one patch for each part.
///
/// Threading: only the run changes; one builder per thread.
/// Ownership: keeps the sampler by reference.
class TileBuilder {
 public:
  /// Tolerance of a weight, in 1 / (1 << kWeightBits): 1.5/256. A head with less than this everywhere in a tile is left
  /// out where other heads can take its share.
  static constexpr int kWeightFit = 192;
  /// Tolerance of a vignetting gain, in 1/32768 of the table's scale.
  static constexpr int kGainFit = 24;
  /// The same for rays that were sorted into tiles: their positions are less regular than the pixels of a picture.
  static constexpr int kGainFitOfRays = 80;
  /// The smallest step between pixels of a tile that is not within a face of the layout: 4 px, in
  /// 1 / (1 << kFractionBits) samples.
  static constexpr int kJump = 4 << blend::kFractionBits;

  /// vignetting_scale: BlendTable's; 0 if no vignetting is undone.
  TileBuilder(const RaySampler& sampler, int grid, int vignetting_scale)
      : sampler_(sampler), grid_(grid), vignetting_scale_(vignetting_scale) {}

  void append(const TileSamples& samples, TileRun& run);
  void append(const ClearTile& tile, TileRun& run);
  /// A tile without any head.
  void append_empty(TileRun& run);

 private:
  /// One head's part in the current tile.
  struct Part {
    HeadIndex head = 0;
    int level = 0;
    PixelMask mask = 0;
    PixelValues x{}, y{};  ///< position in the level's plane, in 1 / (1 << kFractionBits) samples
    PixelValues weight{};
    PixelValues gain{};
  };
  struct Made {
    std::size_t part = 0;
    PixelMask mask = 0;
  };
  void split_by_head(const TileSamples& samples);
  std::int32_t quantize_vignetting(double gain) const;
  std::optional<double> square_step(const Part& part) const;
  double square_between_rays(const Part& part) const;
  void choose_levels();
  void shrink(Part& part) const;
  void add_patches(std::size_t part, PixelMask of, const Block& block, TileRun& run);
  static PixelMask before_jump(const Part& part, PixelMask mask);
  std::optional<std::array<std::int16_t, 4>> fit_gain(const Part& part, PixelMask mask, bool must) const;
  bool add_records(const Part& part, std::span<const PixelMask> masks, bool must, TileRun& run);
  void append_parts(PixelMask inside, TileRun& run);
  void share(PixelMask inside, TileRun& run);
  bool share_bilinear(PixelMask inside, TileRun& run);

  const RaySampler& sampler_;
  int grid_;
  int vignetting_scale_;
  std::vector<Part> parts_;
  std::vector<Made> made_;
};

}  // namespace nodal::table
