// Makes the tiles of a table: the patches that a tile reads, and their weights.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "stitch/blend/blend_table.h"
#include "stitch/table/ray_sampler.h"
#include "stitch/table/tile_fit.h"

namespace nodal::table {

/// A run of tiles with their records, weights, lists and gains; indices are within the run.
struct TileRun {
  std::vector<blend::Tile> tiles;  ///< Tile::record is the index of its first
  std::vector<blend::PatchRecord> records;
  std::vector<std::int16_t> weights;
  std::vector<std::uint16_t> coordinates;
  std::vector<std::array<std::int16_t, 4>> gains;
};

/// The sources of 64 pixels. Pixels that are not in `inside` are beyond the raymap and have no effect.
struct TileSamples {
  std::array<std::vector<RaySample>, blend::kTilePixels> at;  ///< 8 j + i
  PixelMask inside = 0;
};

/// Appends tiles of one grid to a run. A head gives a tile one patch with coordinates by quadratics where those are
/// within kFit of every pixel's own; else one with coordinates listed; and where its pixels lie too far apart for one
/// patch, or its vignetting is no bilinear function of the pixel, a patch for each half, and so on.
///
/// Threading: immutable but for the run; one a thread.
/// Ownership: keeps the sampler by reference.
class TileBuilder {
 public:
  /// In 1 / (1 << kFractionBits): 1/64 px.
  static constexpr int kFit = 64;
  /// Of a weight, in 1 / (1 << kWeightBits): 1.5/256. A head with less everywhere in a tile is left out of it where
  /// others can take its share.
  static constexpr int kWeightFit = 192;
  /// Of a vignetting gain, in 1/32768 of the table's scale.
  static constexpr int kGainFit = 24;
  /// The same where rays were sorted into tiles, and lie only about where a picture's pixels would.
  static constexpr int kGainFitOfRays = 80;

  /// vignetting_scale: BlendTable's; 0 where no vignetting is undone.
  TileBuilder(const RaySampler& sampler, int grid, int vignetting_scale)
      : sampler_(sampler), grid_(grid), vignetting_scale_(vignetting_scale) {}

  void append(TileSamples& samples, TileRun& run);

 private:
  /// One head's part in the tile at hand.
  struct Part {
    HeadIndex head = 0;
    int level = 0;
    PixelMask mask = 0;
    PixelValues x{}, y{};  ///< in 1 / (1 << kFractionBits) samples of the level's plane
    PixelValues weight{};
    PixelValues gain{};
  };
  struct Made {
    std::size_t part = 0;
    PixelMask mask = 0;
  };
  void split_by_head(const TileSamples& samples);
  std::optional<double> square_step(const Part& part) const;
  double square_between_rays(const Part& part) const;
  void choose_levels();
  void shrink(Part& part) const;
  void add_patches(std::size_t part, const Block& block, TileRun& run);
  bool add_patch(const Part& part, PixelMask mask, bool must, TileRun& run);
  void share(const TileSamples& samples, TileRun& run);
  bool share_bilinear(PixelMask inside, TileRun& run);

  const RaySampler& sampler_;
  int grid_;
  int vignetting_scale_;
  std::vector<Part> parts_;
  std::vector<Made> made_;
};

}  // namespace nodal::table
