#include "stitch/table/table_compiler.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/try.h"
#include "stitch/geometry/mask_holes.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/append_record.h"
#include "stitch/table/batches.h"
#include "stitch/table/clear_tile.h"
#include "stitch/table/low_band_compiler.h"
#include "stitch/table/made_rows.h"
#include "stitch/table/quantize.h"
#include "stitch/table/ray_sampler.h"
#include "stitch/table/sphere_order.h"
#include "stitch/table/tile_builder.h"
#include "stitch/table/tone_compiler.h"
#include "stitch/table/validate.h"

namespace nodal::table {
namespace {

/// Y U V are full range: black has Y = 0; U and V are centred at 128.
std::array<blend::ComponentRule, kMaxPlanes> component_rules(PixelFormat format) {
  if (has_chroma(format)) return {{{0, 0, 0}, {1, 128, 1}, {1, 128, 1}}};
  return {{{0, 0, 0}, {0, 0, 1}, {0, 0, 2}}};
}

/// The scale of vignetting gains, in 1/256: the largest gain in any head's region, with a margin;
/// 0 where there is no vignetting.
int vignetting_scale(const RaySampler& sampler) {
  if (!sampler.options().undo_vignetting) return 0;
  constexpr int kSteps = 64;
  double largest = 1;
  bool any = false;
  for (std::size_t h = 0; h < sampler.heads().size(); ++h) {
    const HeadCalibration& head = sampler.heads()[h].calibration();
    for (const double coefficient : head.vignetting.coefficients) any = any || coefficient != 0;
    const Region& region = head.region;
    for (int k = 0; k < kSteps * kSteps; ++k) {
      const geometry::Pixel at{region.left + (region.right - region.left) * (k % kSteps) / (kSteps - 1),
                               region.top + (region.bottom - region.top) * (k / kSteps) / (kSteps - 1)};
      if (region.circle && std::hypot(at.x - region.circle->x, at.y - region.circle->y) > region.circle->radius)
        continue;
      largest = std::max(largest, sampler.optics()[h].undo.undo(sampler.heads()[h].vignetting(at)));
    }
  }
  if (!any) return 0;
  return static_cast<int>(std::clamp<std::int64_t>(round_up_ties(largest * 256 * 1.01), 257, 2048));
}

blend::GridTable empty_table(const RaySampler::Grid& shape) {
  blend::GridTable table;
  table.width = shape.width;
  table.height = shape.height;
  table.row_step = shape.on_raymap.step_y;
  return table;
}

/// Whether there is a pixel that several heads see.
bool any_shared(const TileSamples& tile) {
  return std::ranges::any_of(tile.at, [](const std::vector<RaySample>& at) { return at.size() > 1; });
}

/// Makes the tiles of one grid, in any order.
class GridCompiler {
 public:
  /// `places`: GridTable::places. `of_cover`: tiles whose pixels each have one head at most are empty.
  GridCompiler(const RaySampler& rays, std::size_t grid, std::span<const std::uint32_t> places, bool of_cover,
               int vignetting_scale)
      : rays_(rays),
        grid_(static_cast<int>(grid)),
        shape_(empty_table(rays.grids()[grid])),
        places_(places),
        of_cover_(of_cover),
        sampler_(rays),
        builder_(rays, grid_, vignetting_scale) {}

  void append(int column, int row, TileRun& run) {
    const int left = column * blend::kTile, top = row * blend::kTile;
    if (of_cover_ && has_one_head_at_most(rays_, grid_, left, top)) return builder_.append_empty(run);
    if (const std::optional<ClearTile> clear = clear_tile(rays_, grid_, left, top)) return builder_.append(*clear, run);
    sample(column, row);
    if (of_cover_ && !any_shared(samples_)) return builder_.append_empty(run);
    builder_.append(samples_, run);
  }

 private:
  /// The place of each of the tile's pixels, kNowhere outside the grid.
  std::array<std::uint32_t, blend::kTilePixels> places_of(int column, int row) const {
    std::array<std::uint32_t, blend::kTilePixels> places;
    for (int p = 0; p < blend::kTilePixels; ++p) {
      const auto i = static_cast<std::size_t>(p);
      const int x = column * blend::kTile + p % blend::kTile, y = row * blend::kTile + p / blend::kTile;
      if (!places_.empty()) {
        places[i] = places_[shape_.tile_index(column, row) * blend::kTilePixels + i];
      } else {
        places[i] = x < shape_.width && y < shape_.height ? blend::GridTable::place(x, y) : blend::GridTable::kNowhere;
      }
    }
    return places;
  }
  void sample(int column, int row) {
    const std::array<std::uint32_t, blend::kTilePixels> places = places_of(column, row);
    sampler_.sample(grid_, places);
    samples_.inside = 0;
    for (std::size_t p = 0; p < blend::kTilePixels; ++p) {
      if (places[p] == blend::GridTable::kNowhere) continue;
      const std::span<const RaySample> at = sampler_.at(static_cast<int>(p));
      samples_.at[p].assign(at.begin(), at.end());
      samples_.inside |= PixelMask{1} << p;
    }
  }

  const RaySampler& rays_;
  int grid_;
  blend::GridTable shape_;
  std::span<const std::uint32_t> places_;
  bool of_cover_;
  RowSampler sampler_;
  TileBuilder builder_;
  TileSamples samples_;
};

/// Appends tile k of a run, with its records, weights, lists and gains, to the table.
void append_tile(TileRun& run, std::size_t k, blend::GridTable& table) {
  const std::size_t first = run.tiles[k].record;
  const std::size_t last = k + 1 < run.tiles.size() ? run.tiles[k + 1].record : run.records.size();
  const auto weights_of = [&](std::size_t tile) {
    return tile < run.tiles.size() && run.tiles[tile].sharing != 0 ? run.tiles[tile].weights() : run.weights.size();
  };
  blend::Tile tile{static_cast<std::uint32_t>(table.records.size()), 0};
  if (run.tiles[k].sharing != 0) {
    std::size_t next = k + 1;
    while (next < run.tiles.size() && run.tiles[next].sharing == 0) ++next;
    tile.sharing = (run.tiles[k].sharing & 0xc0000000U) | static_cast<std::uint32_t>(table.weights.size() / 4);
    table.weights.insert(table.weights.end(), run.weights.begin() + static_cast<std::ptrdiff_t>(weights_of(k)),
                         run.weights.begin() + static_cast<std::ptrdiff_t>(weights_of(next)));
  }
  for (std::size_t r = first; r < last; ++r) {
    append_record(run.records[r], run.coordinates, table);
    if (!run.gains.empty()) table.gains.push_back(run.gains[r]);
  }
  table.tiles.push_back(tile);
}

/// Makes one grid from its rows of tiles, in the order in which they are blended. The rows of a block are freed as soon
/// as it is made: the rig does not have the memory for two copies of the table.
Result<blend::GridTable> join(const RaySampler::Grid& shape, std::span<TileRun> rows) {
  blend::GridTable table = empty_table(shape);
  std::size_t records = 0, weights = 0, coordinates = 0, gains = 0;
  for (const TileRun& row : rows) {
    records += row.records.size();
    weights += row.weights.size();
    coordinates += row.coordinates.size();
    gains += row.gains.size();
  }
  if (records > std::numeric_limits<std::uint32_t>::max() || weights / 4 >= 1U << 30) {
    return fail(
        Errc::kTooLarge,
        fmt::format(
            "the blend table would have {} patches and {} weights, more than it can number; ask for a smaller raymap",
            records, weights));
  }
  table.tiles.reserve(table.tile_count() + 1);
  table.records.reserve(records);
  table.weights.reserve(weights);
  table.coordinates.reserve(coordinates);
  table.gains.reserve(gains);
  for (int block = 0; block < table.tiles_down(); block += table.block_rows()) {
    for (int column = 0; column < table.tiles_across(); column += blend::GridTable::kBlockTiles) {
      for (int row = block; row < block + table.block_rows(); ++row) {
        for (int k = column; k < column + blend::GridTable::kBlockTiles; ++k) {
          const bool present = static_cast<std::size_t>(row) < rows.size() && k * blend::kTile < shape.width;
          if (present) {
            append_tile(rows[static_cast<std::size_t>(row)], static_cast<std::size_t>(k), table);
          } else {
            table.tiles.push_back({static_cast<std::uint32_t>(table.records.size()), 0});
          }
        }
      }
    }
    for (int row = block; row < block + table.block_rows() && static_cast<std::size_t>(row) < rows.size(); ++row) {
      rows[static_cast<std::size_t>(row)] = TileRun{};
    }
  }
  table.tiles.push_back({static_cast<std::uint32_t>(table.records.size()), 0});
  return table;
}

/// "; the masks of head ..." for heads whose masks leave a hole.
std::string masks_that_hide(std::span<const geometry::Head> heads) {
  const std::vector<geometry::Head> all(heads.begin(), heads.end());
  std::string text;
  for (const std::string& sentence : geometry::describe(geometry::find_mask_holes(all), all)) text += "; " + sentence;
  return text;
}

int tile_rows(const RaySampler::Grid& grid) { return (grid.height + blend::kTile - 1) / blend::kTile; }

}  // namespace

struct TableCompiler::Work {
  std::unique_ptr<geometry::RaymapLayout> own_layout;  ///< if make() was given a layout's name
  RaySampler sampler;
  std::optional<RaySampler> cover;       ///< cover for BlendTable::cover and two bands; empty: neither is wanted
  int vignetting_scale = 0;              ///< 0: nothing to undo
  std::vector<TileRun> rows;             ///< tiles of every grid, then of every grid of the cover
  std::vector<SphereOrder> orders;       ///< by grid, for scattered layouts; else empty
  std::vector<std::uint16_t> low_sizes;  ///< by head; empty: one band
  std::vector<std::vector<blend::LowGrid>> low;  ///< by grid, then row of blocks

  void compile_rows(const RaySampler& rays, int first, int begin, int end);
};

TableCompiler::TableCompiler(std::unique_ptr<Work> work) : work_(std::move(work)) {
  std::size_t rows = 0;
  for (const RaySampler::Grid& grid : work_->sampler.grids()) rows += static_cast<std::size_t>(tile_rows(grid));
  work_->rows.resize(work_->cover ? 2 * rows : rows);
  work_->vignetting_scale = vignetting_scale(work_->sampler);
  if (work_->sampler.options().transition == Transition::kTwoBand) work_->low_sizes = low_sizes(*work_->cover);
  const bool scattered = work_->sampler.layout().scattered();
  for (std::size_t g = 0; g < work_->sampler.grids().size(); ++g) {
    work_->orders.emplace_back();
    if (scattered) work_->orders.back() = sphere_order(work_->sampler, static_cast<int>(g));
    const blend::GridTable shape = empty_table(work_->sampler.grids()[g]);
    work_->low.emplace_back(static_cast<std::size_t>(shape.tiles_down() / shape.block_rows()));
  }
}
TableCompiler::TableCompiler(TableCompiler&&) noexcept = default;
TableCompiler& TableCompiler::operator=(TableCompiler&&) noexcept = default;
TableCompiler::~TableCompiler() = default;

Result<TableCompiler> TableCompiler::make(const Calibration& calibration, const RaymapSpec& raymap,
                                          std::span<const PixelFormat> head_formats, const TableOptions& options) {
  NODAL_TRY_ASSIGN(std::unique_ptr<geometry::RaymapLayout> layout,
                   geometry::make_layout(raymap.layout, raymap.width, raymap.height));
  Result<TableCompiler> compiler = make(calibration, *layout, raymap.format, head_formats, options);
  if (compiler) compiler->work_->own_layout = std::move(layout);
  return compiler;
}

Result<TableCompiler> TableCompiler::make(const Calibration& calibration, const geometry::RaymapLayout& layout,
                                          PixelFormat raymap_format, std::span<const PixelFormat> head_formats,
                                          const TableOptions& options) {
  NODAL_TRY_ASSIGN(RaySampler sampler, RaySampler::make(calibration, layout, raymap_format, head_formats, options));
  auto work = std::make_unique<Work>(Work{nullptr, std::move(sampler), std::nullopt, 0, {}, {}, {}, {}});
  if (options.transition != Transition::kFeather) {
    TableOptions all = options;
    all.transition = Transition::kFeather;
    NODAL_TRY_ASSIGN(RaySampler cover, RaySampler::make(calibration, layout, raymap_format, head_formats, all));
    work->cover = std::move(cover);
  }
  return TableCompiler(std::move(work));
}

CompileCost TableCompiler::cost() const { return compile_cost(work_->sampler); }

int TableCompiler::row_count() const { return static_cast<int>(work_->rows.size()); }

void TableCompiler::compile_rows(int begin, int end) {
  work_->compile_rows(work_->sampler, 0, begin, end);
  if (work_->cover) work_->compile_rows(*work_->cover, row_count() / 2, begin, end);
}

/// Compiles those of rows [begin, end) that are of one of the two tables, whose rows begin at `first`.
void TableCompiler::Work::compile_rows(const RaySampler& rays, int first, int begin, int end) {
  for (std::size_t g = 0; g < rays.grids().size(); ++g) {
    const RaySampler::Grid& shape = rays.grids()[g];
    GridCompiler compiler(rays, g, orders[g].places, &rays != &sampler, vignetting_scale);
    const blend::GridTable empty = empty_table(shape);
    std::optional<LowBandCompiler> low_band;
    if (!low_sizes.empty() && &rays == &*cover) {
      low_band.emplace(rays, static_cast<int>(g), empty, orders[g].places, low_sizes, vignetting_scale);
    }
    for (int r = std::max(begin, first); r < std::min(end, first + tile_rows(shape)); ++r) {
      if (&rays == &sampler || rays.options().cover) {
        TileRun& row = rows[static_cast<std::size_t>(r)];
        row = TileRun{};
        for (int column = 0; column * blend::kTile < shape.width; ++column) {
          compiler.append(column, r - first, row);
        }
        row.records.shrink_to_fit();
        row.weights.shrink_to_fit();
      }
      if (low_band && (r - first) % empty.block_rows() == 0) {
        const int block_row = (r - first) / empty.block_rows();
        low[g][static_cast<std::size_t>(block_row)] = low_band->compile(block_row);
      }
    }
    first += tile_rows(shape);
  }
}

Result<blend::BlendTable> TableCompiler::finish() && {
  const RaySampler& sampler = work_->sampler;
  blend::BlendTable table;
  table.format = sampler.raymap_format();
  table.width = sampler.layout().width();
  table.height = sampler.layout().height();
  table.components = component_rules(table.format);
  if (is_linear16(table.format)) table.linear = linear_numbers(sampler.power());
  for (std::size_t h = 0; h < sampler.heads().size(); ++h) {
    const geometry::Head& head = sampler.heads()[h];
    blend::BlendTable::Source source{sampler.head_formats()[h], head.width(), head.height()};
    source.field = sampler.options().field;
    if (source.field) source.height /= 2;
    for (std::size_t k = 0; k < 3; ++k) source.gain[k] = quantize_gain(sampler.optics()[h].gain[k]);
    source.sharpen = static_cast<std::uint8_t>(std::clamp(sampler.options().sharpen, 0, blend::kMaxSharpen));
    table.sources.push_back(source);
  }
  if (work_->vignetting_scale != 0) table.vignetting_scale = static_cast<std::uint16_t>(work_->vignetting_scale);
  std::span<TileRun> rows(work_->rows);
  std::uint32_t unshrunk = 0;  // heads with a record of level 0 (the picture itself), one bit each
  const auto add_grids = [&](std::vector<blend::GridTable>& grids) -> Status {
    for (const RaySampler::Grid& shape : sampler.grids()) {
      const auto height = static_cast<std::size_t>(tile_rows(shape));
      NODAL_TRY_ASSIGN(blend::GridTable grid, join(shape, rows.first(height)));
      rows = rows.subspan(height);
      for (const blend::PatchRecord& record : grid.records) {
        std::uint8_t& levels = table.sources[record.head()].levels;
        levels = std::max(levels, static_cast<std::uint8_t>(record.pyramid_level() + 1));
        if (record.pyramid_level() == 0) unshrunk |= 1U << record.head();
      }
      grids.push_back(std::move(grid));
    }
    return {};
  };
  NODAL_TRY(add_grids(table.grids));
  for (std::size_t g = 0; g < table.grids.size(); ++g) {
    table.grids[g].places = std::move(work_->orders[g].places);
    add_batches(table.grids[g], components_on(table.format, static_cast<int>(g)), work_->orders[g].cells);
    if (work_->low_sizes.empty()) continue;
    for (const blend::LowGrid& low : work_->low[g]) append(low, table.grids[g].low);
  }
  for (std::size_t h = 0; h < work_->low_sizes.size(); ++h) table.sources[h].low_size = work_->low_sizes[h];
  if (work_->cover && sampler.options().cover) {
    NODAL_TRY(add_grids(table.cover));
  }
  if (table.grids[0].records.empty()) {
    return fail(Errc::kNoCoverage, "no head sees any ray of the " + std::string(sampler.layout().name()) +
                                       " raymap; check the heads' regions and rotations" +
                                       masks_that_hide(sampler.heads()));
  }
  for (std::size_t h = 0; h < table.sources.size(); ++h) {
    if ((unshrunk >> h & 1) == 0) table.sources[h].sharpen = 0;
  }
  name_made_rows(table);
  NODAL_TRY(validate_blend_table(table));
  return table;
}

Result<blend::BlendTable> compile_blend_table(const Calibration& calibration, const RaymapSpec& raymap,
                                              std::span<const PixelFormat> head_formats, const TableOptions& options) {
  NODAL_TRY_ASSIGN(TableCompiler compiler, TableCompiler::make(calibration, raymap, head_formats, options));
  compiler.compile_rows(0, compiler.row_count());
  return std::move(compiler).finish();
}

Result<blend::BlendTable> compile_blend_table(const Calibration& calibration, const geometry::RaymapLayout& layout,
                                              PixelFormat raymap_format, std::span<const PixelFormat> head_formats,
                                              const TableOptions& options) {
  NODAL_TRY_ASSIGN(TableCompiler compiler,
                   TableCompiler::make(calibration, layout, raymap_format, head_formats, options));
  compiler.compile_rows(0, compiler.row_count());
  return std::move(compiler).finish();
}

}  // namespace nodal::table
