#include "stitch/table/sphere_order.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "stitch/table/quantize.h"

namespace nodal::table {
namespace {

/// A pixel and its ray's angles in whole numbers: in doubles, the last bits would decide, and differ by machine.
struct Placed {
  std::uint32_t place = 0;
  std::int32_t strip = 0;
  std::int32_t theta = 0;
  std::int32_t phi = 0;
};

constexpr double kSteps = 1 << 28;  // to pi

std::vector<Placed> placed(const RaySampler& sampler, int grid) {
  const RaySampler::Grid& shape = sampler.grids()[static_cast<std::size_t>(grid)];
  const double rays = static_cast<double>(shape.width) * shape.height;
  // Steradians a ray: 4 pi / rays.
  const double strip_height = blend::kTile * std::sqrt(4 * std::numbers::pi / rays);
  const double strips = std::max(1.0, std::round(std::numbers::pi / strip_height));
  std::vector<Placed> all;
  all.reserve(static_cast<std::size_t>(rays));
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      Placed& pixel = all.emplace_back(Placed{blend::GridTable::place(x, y), INT32_MAX, 0, 0});
      const std::optional<geometry::Ray> ray = sampler.ray(grid, x, y);
      if (!ray) continue;
      const geometry::Angles at = ray->angles();
      pixel.theta = static_cast<std::int32_t>(round_up_ties(at.theta / std::numbers::pi * kSteps));
      pixel.phi = static_cast<std::int32_t>(round_up_ties((at.phi / std::numbers::pi + 0.5) * kSteps));
      pixel.strip = static_cast<std::int32_t>(std::min(strips - 1, std::floor(pixel.phi / kSteps * strips)));
    }
  }
  return all;
}

/// Puts the rays of one tile where they lie to each other: `width` columns by longitude, each by latitude.
void lay(std::span<Placed> rays, std::size_t width, std::size_t height, std::uint32_t* tile) {
  for (std::size_t i = 0; i < width; ++i) {
    const std::span<Placed> column = rays.subspan(i * height, height);
    std::sort(column.begin(), column.end(), [](const Placed& a, const Placed& b) {
      return a.phi != b.phi ? a.phi < b.phi : a.place < b.place;
    });
    for (std::size_t j = 0; j < height; ++j) tile[j * blend::kTile + i] = column[j].place;
  }
}

}  // namespace

std::vector<std::uint32_t> sphere_order(const RaySampler& sampler, int grid) {
  std::vector<Placed> rays = placed(sampler, grid);
  std::sort(rays.begin(), rays.end(), [](const Placed& a, const Placed& b) {
    if (a.strip != b.strip) return a.strip < b.strip;
    return a.theta != b.theta ? a.theta < b.theta : a.place < b.place;
  });
  const RaySampler::Grid& shape = sampler.grids()[static_cast<std::size_t>(grid)];
  blend::GridTable table;
  table.width = shape.width;
  table.height = shape.height;
  table.row_step = shape.on_raymap.step_y;
  std::vector<std::uint32_t> places(table.tile_count() * blend::kTilePixels, blend::GridTable::kNowhere);
  std::span<Placed> left(rays);
  for (int block = 0; block < table.tiles_down(); block += table.block_rows()) {
    for (int first = 0; first < table.tiles_across(); first += blend::GridTable::kBlockTiles) {
      for (int row = block; row < block + table.block_rows(); ++row) {
        for (int column = first; column < first + blend::GridTable::kBlockTiles; ++column) {
          const int width = std::clamp(shape.width - column * blend::kTile, 0, blend::kTile);
          const int height = std::clamp(shape.height - row * blend::kTile, 0, blend::kTile);
          const auto count = static_cast<std::size_t>(width * height);
          lay(left.first(count), count == 0 ? 0 : static_cast<std::size_t>(width), static_cast<std::size_t>(height),
              &places[table.tile_index(column, row) * blend::kTilePixels]);
          left = left.subspan(count);
        }
      }
    }
  }
  return places;
}

}  // namespace nodal::table
