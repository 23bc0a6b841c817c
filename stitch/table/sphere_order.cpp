#include "stitch/table/sphere_order.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>
#include <tuple>

#include "stitch/table/batches.h"
#include "stitch/table/quantize.h"

namespace nodal::table {
namespace {

/// A pixel and its ray's angles as integers: the order of doubles would depend on their last bits, which differ between
/// machines.
struct Placed {
  std::uint32_t place = 0;
  std::int32_t part = 0;  ///< the number of its strip or its cell
  std::int32_t theta = 0;
  std::int32_t phi = 0;
};

constexpr double kAngleSteps = 1 << 28;  // steps of the integer angles in pi
constexpr std::int32_t kNoPart = INT32_MAX;
/// Fewest rays of a cell. With fewer, more tiles are in two cells; with more, a batch has fewer cells, and its runs are
/// shorter.
constexpr std::int64_t kCellRays = 1024;
/// With fewer compact cells, the raymap is so small (below half a megapixel) that strips of the whole sphere are
/// faster: they need fewer patches, and all lines of the raymap stay in the cache.
constexpr std::uint64_t kMinCells = 400;
/// Cells around the sphere that are lower, in rays, have elongated tiles, which need more patches.
constexpr double kMinSide = 5;

bool by_phi(const Placed& a, const Placed& b) { return a.phi != b.phi ? a.phi < b.phi : a.place < b.place; }
bool by_theta(const Placed& a, const Placed& b) { return a.theta != b.theta ? a.theta < b.theta : a.place < b.place; }

double latitude(double phi) { return std::numbers::pi * (phi / kAngleSteps - 0.5); }

std::vector<Placed> placed(const RaySampler& sampler, int grid) {
  const RaySampler::Grid& shape = sampler.grids()[static_cast<std::size_t>(grid)];
  std::vector<Placed> all;
  all.reserve(static_cast<std::size_t>(shape.width) * static_cast<std::size_t>(shape.height));
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      Placed& pixel = all.emplace_back(Placed{blend::GridTable::place(x, y), kNoPart, 0, 0});
      const std::optional<geometry::Ray> ray = sampler.ray(grid, x, y);
      if (!ray) continue;
      const geometry::Angles at = ray->angles();
      pixel.part = 0;
      pixel.theta = static_cast<std::int32_t>(round_up_ties(at.theta / std::numbers::pi * kAngleSteps));
      pixel.phi = static_cast<std::int32_t>(round_up_ties((at.phi / std::numbers::pi + 0.5) * kAngleSteps));
    }
  }
  return all;
}

/// The number of strips from pole to pole. Each of n evenly spread rays has a solid angle of 4 pi / n.
std::int64_t strips_of(const RaySampler::Grid& shape) {
  const double rays = static_cast<double>(shape.width) * shape.height;
  const double height = blend::kTile * std::sqrt(4 * std::numbers::pi / rays);
  return std::max<std::int64_t>(1, round_up_ties(std::numbers::pi / height));
}

/// Strips of the whole sphere from pole to pole, each ordered by longitude.
void order_in_strips(std::vector<Placed>& rays, std::int64_t strips) {
  for (Placed& ray : rays) {
    if (ray.part == kNoPart) continue;
    const std::int64_t strip = ray.phi * strips / static_cast<std::int64_t>(kAngleSteps);
    ray.part = static_cast<std::int32_t>(std::min(strips - 1, strip));
  }
  std::sort(rays.begin(), rays.end(),
            [](const Placed& a, const Placed& b) { return a.part != b.part ? a.part < b.part : by_theta(a, b); });
}

/// Orders the rays of one cell, from `begin` to `end` of all, in strips of about square tiles. A strip has whole tiles,
/// because a tile of two strips reads patches for both.
void order_cell(std::vector<Placed>& rays, std::size_t begin, std::size_t end) {
  const auto iterator = [&](std::size_t k) { return rays.begin() + static_cast<std::ptrdiff_t>(k); };
  std::sort(iterator(begin), iterator(end), by_phi);
  const auto [west, east] = std::minmax_element(iterator(begin), iterator(end), by_theta);
  const double height = static_cast<double>(rays[end - 1].phi) - rays[begin].phi;
  const double middle = latitude((static_cast<double>(rays[end - 1].phi) + rays[begin].phi) / 2);
  const double width = std::max(1.0, (static_cast<double>(east->theta) - west->theta) * std::cos(middle));
  const std::size_t count = end - begin;
  const auto strips = static_cast<std::size_t>(std::max<std::int64_t>(
      1, round_up_ties(std::sqrt(height / width * static_cast<double>(count) / blend::kTilePixels))));
  for (std::size_t k = 1, from = begin; k <= strips; ++k) {
    const std::size_t nearest = (begin + count * k / strips + blend::kTilePixels / 2) / blend::kTilePixels;
    const std::size_t to = k == strips ? end : std::clamp(nearest * blend::kTilePixels, from, end);
    std::sort(iterator(from), iterator(to), by_theta);
    from = to;
  }
}

/// The layout's cells, each small enough for one batch of the grid; none if strips of the whole sphere are better.
geometry::RaymapLayout::Cells cells_of(const RaySampler& sampler, int grid) {
  using Cells = geometry::RaymapLayout::Cells;
  const geometry::RaymapLayout& layout = sampler.layout();
  const PlaneGrid& on_raymap = sampler.grids()[static_cast<std::size_t>(grid)].on_raymap;
  // Pixels of the raymap per pixel of the grid.
  const std::int64_t pixels = std::int64_t{on_raymap.step_x} * on_raymap.step_y;
  const std::size_t strips = blend::GridTable::most_strips(components_on(sampler.raymap_format(), grid));
  constexpr std::int64_t kStripPixels = blend::GridTable::kBlockTiles * blend::kTilePixels;
  const std::int64_t most = static_cast<std::int64_t>(strips) * kStripPixels * pixels;
  const Cells cells = layout.cells(kCellRays, blend::kTile * on_raymap.step_y);
  if (cells.run == 1) return cells.count < kMinCells ? Cells{} : cells;
  // Cells of consecutive pixels can have any size. Batches have whole strips, so cells should, too. In a grid with
  // steps, a cell has the same number of pixels as every other if it has whole rows of the grid.
  const std::int64_t strip = kStripPixels * pixels;
  const std::int64_t with_rows = std::lcm(strip, std::int64_t{layout.width()} * on_raymap.step_y);
  const auto run = static_cast<std::int64_t>(cells.run);
  const std::int64_t unit = on_raymap.step_y > 1 && with_rows <= run / 4 ? with_rows : strip;
  const std::int64_t whole = std::min((run + unit - 1) / unit, most / unit) * unit;
  if (static_cast<double>(whole) < static_cast<double>(run) * kMinSide / blend::kTile) return {};
  return layout.cells(whole, 0);
}

/// Orders the rays cell by cell. Returns the index of each cell's first ray.
std::vector<std::size_t> order_in_cells(std::vector<Placed>& rays, const geometry::RaymapLayout::Cells& cells,
                                        const RaySampler& sampler, int grid) {
  const auto width = static_cast<std::uint64_t>(sampler.layout().width());
  const auto height = static_cast<std::uint64_t>(sampler.layout().height());
  for (Placed& ray : rays) {
    if (ray.part == kNoPart) continue;
    const geometry::Pixel at = sampler.on_raymap(grid, ray.place & 0xffff, ray.place >> 16);
    const std::uint64_t row = std::min(static_cast<std::uint64_t>(at.y), height - 1);
    const std::uint64_t pixel = row * width + std::min(static_cast<std::uint64_t>(at.x), width - 1);
    ray.part = static_cast<std::int32_t>(cells.of(pixel));
  }
  std::sort(rays.begin(), rays.end(),
            [](const Placed& a, const Placed& b) { return a.part != b.part ? a.part < b.part : a.place < b.place; });
  std::vector<std::size_t> first;
  for (std::size_t begin = 0; begin < rays.size() && rays[begin].part != kNoPart;) {
    first.push_back(begin);
    std::size_t end = begin + 1;
    while (end < rays.size() && rays[end].part == rays[begin].part) ++end;
    order_cell(rays, begin, end);
    begin = end;
  }
  return first;
}

/// Orders tiles of 64 rays in blocks of about eight strips by eight tiles, so that samples which neighbouring tiles
/// share are still in the cache.
std::vector<Placed> in_blocks(const std::vector<Placed>& rays, std::int64_t strips) {
  constexpr std::int64_t kStrips = 8;
  struct Tile {
    std::size_t first;
    std::int64_t band, cell, strip;
  };
  std::vector<Tile> tiles;
  for (std::size_t first = 0; first < rays.size(); first += blend::kTilePixels) {
    const Placed& ray = rays[first];
    const std::int64_t strip = std::min<std::int64_t>(ray.part, strips);
    const std::int64_t band = strip / kStrips;
    const double bands = static_cast<double>(strips) / kStrips;
    const double middle = latitude((static_cast<double>(band) + 0.5) / bands * kAngleSteps);
    const double around = 2 * bands * std::max(0.0, std::cos(middle));
    const std::int64_t cells = std::max<std::int64_t>(1, round_up_ties(around));
    const auto half = static_cast<std::int64_t>(kAngleSteps);
    tiles.push_back({first, band, (ray.theta + half) * cells / (2 * half + 1), strip});
  }
  std::ranges::stable_sort(tiles, [](const Tile& a, const Tile& b) {
    return std::tie(a.band, a.cell, a.strip) < std::tie(b.band, b.cell, b.strip);
  });
  std::vector<Placed> sorted;
  sorted.reserve(rays.size());
  for (const Tile& tile : tiles) {
    const auto from = rays.begin() + static_cast<std::ptrdiff_t>(tile.first);
    sorted.insert(sorted.end(), from, from + blend::kTilePixels);
  }
  return sorted;
}

/// Arranges the rays of one tile: `width` columns ordered by longitude, each column ordered by latitude.
void lay(std::span<Placed> rays, std::size_t width, std::size_t height, std::uint32_t* tile) {
  for (std::size_t i = 0; i < width; ++i) {
    const std::span<Placed> column = rays.subspan(i * height, height);
    std::sort(column.begin(), column.end(), by_phi);
    for (std::size_t j = 0; j < height; ++j) tile[j * blend::kTile + i] = column[j].place;
  }
}

}  // namespace

SphereOrder sphere_order(const RaySampler& sampler, int grid) {
  const RaySampler::Grid& shape = sampler.grids()[static_cast<std::size_t>(grid)];
  std::vector<Placed> rays = placed(sampler, grid);
  std::vector<std::size_t> first_rays;  // index of each cell's first ray
  if (const geometry::RaymapLayout::Cells cells = cells_of(sampler, grid); cells.count != 0) {
    first_rays = order_in_cells(rays, cells, sampler, grid);
  } else {
    const std::int64_t strips = strips_of(shape);
    order_in_strips(rays, strips);
    if (shape.width % blend::kTile == 0 && shape.height % blend::kTile == 0) rays = in_blocks(rays, strips);
  }
  blend::GridTable table;
  table.width = shape.width;
  table.height = shape.height;
  table.row_step = shape.on_raymap.step_y;
  SphereOrder order{std::vector(table.tile_count() * blend::kTilePixels, blend::GridTable::kNowhere), {}};
  std::span<Placed> left(rays);
  for (int block = 0; block < table.tiles_down(); block += table.block_rows()) {
    for (int first = 0; first < table.tiles_across(); first += blend::GridTable::kBlockTiles) {
      for (int row = block; row < block + table.block_rows(); ++row) {
        for (int column = first; column < first + blend::GridTable::kBlockTiles; ++column) {
          const int width = std::clamp(shape.width - column * blend::kTile, 0, blend::kTile);
          const int height = std::clamp(shape.height - row * blend::kTile, 0, blend::kTile);
          const auto count = static_cast<std::size_t>(width * height);
          const std::size_t end = rays.size() - left.size() + count;
          while (order.cells.size() < first_rays.size() && first_rays[order.cells.size()] < end) {
            order.cells.push_back(static_cast<std::uint32_t>(table.tile_index(column, row)));
          }
          lay(left.first(count), count == 0 ? 0 : static_cast<std::size_t>(width), static_cast<std::size_t>(height),
              &order.places[table.tile_index(column, row) * blend::kTilePixels]);
          left = left.subspan(count);
        }
      }
    }
  }
  return order;
}

}  // namespace nodal::table
