#include "stitch/table/low_band_compiler.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stitch/table/head_sight.h"
#include "stitch/table/quantize.h"

namespace nodal::table {
namespace {

constexpr int kCellPixels = 16;  // side of a low picture's square, in pixels of the raymap
/// How far inside its region a head must see a point, in sides of the low picture's squares. A low picture between its
/// samples is a mean with a standard deviation of 0.87 sides, so that at this margin, where the head's weight begins at
/// 0, about 7 % of it are outside. A larger margin would leave more narrow overlaps uncorrected.
constexpr double kMargin = 1.25;
/// Corners are taken this far inside their cell, px of the grid: at the edge of a face of the layout, the ray on the
/// edge may be that of another face.
constexpr double kInside = 1.0 / 64;
/// Corners of two cells are one point if their rays differ by less than this share of the cell's diagonal.
constexpr double kSame = 1.0 / 16;

}  // namespace

std::vector<std::uint16_t> low_sizes(const RaySampler& sampler) {
  const double pixels = static_cast<double>(sampler.layout().width()) * sampler.layout().height();
  const double raymap_density = pixels / (4 * std::numbers::pi);  // mean, in pixels per steradian
  std::vector<std::uint16_t> sizes;
  for (const geometry::Head& head : sampler.heads()) {
    const Region& region = head.calibration().region;
    const double density = head.density({(region.left + region.right) / 2, (region.top + region.bottom) / 2});
    const double ratio = density > 0 ? std::sqrt(density / raymap_density) : 1;
    const double doublings = std::clamp(std::round(std::log2(kCellPixels / double{blend::kMinLowSize} * ratio)), 0.0,
                                        std::log2(double{blend::kMaxLowSize} / blend::kMinLowSize));
    sizes.push_back(static_cast<std::uint16_t>(blend::kMinLowSize << static_cast<int>(doublings)));
  }
  return sizes;
}

LowBandCompiler::LowBandCompiler(const RaySampler& wide, int grid, const blend::GridTable& shape,
                                 std::span<const std::uint32_t> places, std::span<const std::uint16_t> sizes,
                                 int vignetting_scale)
    : wide_(wide),
      grid_(grid),
      shape_(shape),
      places_(places),
      sizes_(sizes),
      vignetting_scale_(vignetting_scale),
      sampler_(wide) {
  // Cells of 16 pixels of the raymap. Tiles of sorted rays need not lie side by side on the sphere.
  shape_.low.cell_tiles = shape_.row_step == 1 && places_.empty() ? 2 : 1;
}

/// The corners' rays of a cell; column and row count cells of the grid. Cells beyond the grid have none.
LowBandCompiler::Cell LowBandCompiler::cell_at(int column, int row) const {
  if (!places_.empty()) return cell_of_sorted_rays(column, row);
  const int side = shape_.low.cell_tiles * blend::kTile;
  const PlaneGrid& plane_grid = wide_.grids()[static_cast<std::size_t>(grid_)].on_raymap;
  const geometry::RaymapLayout& layout = wide_.layout();
  Cell cell;
  if (column * side >= shape_.width || row * side >= shape_.height) return cell;
  for (std::size_t k = 0; k < 4; ++k) {
    const auto at = [&](int first, bool far, double offset, int step, int size) {
      const double inside = far ? -kInside : kInside;
      return std::clamp(((first + (far ? 1 : 0)) * side + inside - offset) * step, kInside, size - kInside);
    };
    cell.corners[k] = layout.ray(at(column, k % 2 == 1, plane_grid.offset_x, plane_grid.step_x, layout.width()),
                                 at(row, k / 2 == 1, plane_grid.offset_y, plane_grid.step_y, layout.height()));
  }
  return cell;
}

/// All corners are the middle of the rays in the cell's tiles.
LowBandCompiler::Cell LowBandCompiler::cell_of_sorted_rays(int column, int row) const {
  const int tiles = shape_.low.cell_tiles;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = 0; k < tiles * tiles; ++k) {
    const std::size_t t = shape_.tile_index(column * tiles + k % tiles, row * tiles + k / tiles);
    for (std::size_t p = 0; p < blend::kTilePixels; ++p) {
      const std::uint32_t place = places_[t * blend::kTilePixels + p];
      if (place == blend::GridTable::kNowhere) continue;
      const auto ray = wide_.ray(grid_, static_cast<int>(place & 0xffff), static_cast<int>(place >> 16));
      if (ray) sum += ray->direction();
    }
  }
  Cell cell;
  if (sum.norm() > 1e-6) cell.corners.fill(geometry::Ray::towards(sum));
  return cell;
}

/// Adds the sights of a point. Places of `seen` are in samples of the grid's component plane.
void LowBandCompiler::add_sights(std::span<const RaySample> seen, blend::LowGrid& low) const {
  std::vector<RaySample> kept;
  double sum = 0;
  for (RaySample sample : seen) {
    const geometry::Head& head = wide_.heads()[sample.head];
    const RaySampler::Plane& plane = wide_.plane(grid_, sample.head);
    const geometry::Pixel at{(sample.x + 0.5 - plane.on_picture.offset_x) * plane.on_picture.step_x,
                             (sample.y + 0.5 - plane.on_picture.offset_y) * plane.on_picture.step_y};
    const double inside = head.distance_to_edge(at) - kMargin * sizes_[sample.head];
    sample.weight = head.density(at) * smoothstep(inside * wide_.optics()[sample.head].depth_per_px);
    if (!(inside > 0 && sample.weight > 0)) continue;
    kept.push_back(sample);
    sum += sample.weight;
  }
  std::erase_if(kept, [&](const RaySample& sample) { return sample.weight < sum * wide_.options().least_weight; });
  if (!kept.empty()) {
    sum = 0;
    for (const RaySample& sample : kept) sum += sample.weight;
    for (RaySample& sample : kept) sample.weight /= sum;
    std::array<std::uint16_t, kMaxHeads> weights{};
    share_out(kept, weights);
    for (std::size_t k = 0; k < kept.size(); ++k) {
      const RaySample& sample = kept[k];
      const int square = sizes_[sample.head] / (grid_ == 0 ? 1 : 2);
      const RaySampler::Plane& plane = wide_.plane(grid_, sample.head);
      const auto quantized = [&](double place, int size) {
        const double at = (place + 0.5) / square - 0.5;
        const int last = std::max(1, size / square) - 1;
        return static_cast<std::uint16_t>(std::clamp<std::int64_t>(round_up_ties(at * 256), 0, last * 256));
      };
      blend::LowSight sight{quantized(sample.x, plane.width), quantized(sample.y, plane.height), weights[k], 0,
                            sample.head};
      if (vignetting_scale_ != 0) {
        sight.gain = static_cast<std::int16_t>(
            std::clamp<std::int64_t>(round_up_ties(sample.gain * (256.0 * 32768 / vignetting_scale_)), 1, 32767));
      }
      low.sights.push_back(sight);
    }
  }
  low.first_sight.push_back(static_cast<std::uint32_t>(low.sights.size()));
}

void LowBandCompiler::add_block(int block_column, int block_row, blend::LowGrid& low) {
  struct Point {
    int x = 0, y = 0;  ///< corner of the block's cells
    Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  };
  std::vector<Point> points;
  std::vector<std::optional<geometry::Ray>> rays;
  std::optional<std::uint8_t> nowhere;
  for (int y = 0; y < shape_.low_cells_down(); ++y) {
    for (int x = 0; x < shape_.low_cells_across(); ++x) {
      const Cell cell = cell_at(block_column * shape_.low_cells_across() + x, block_row * shape_.low_cells_down() + y);
      std::array<std::uint8_t, 4>& numbers = low.cells.emplace_back();
      for (std::size_t k = 0; k < 4; ++k) {
        if (!cell.corners[k]) {
          if (!nowhere) {
            nowhere = static_cast<std::uint8_t>(points.size());
            points.push_back({-1, -1});
            rays.push_back(std::nullopt);
          }
          numbers[k] = *nowhere;
          continue;
        }
        const Eigen::Vector3d& direction = cell.corners[k]->direction();
        const auto& opposite = cell.corners[3 - k];
        const double diagonal = opposite ? (opposite->direction() - direction).norm() : 0;
        const bool sorted = !places_.empty();  // all corners are one point
        const int at_x = sorted ? x : x + static_cast<int>(k % 2);
        const int at_y = sorted ? y : y + static_cast<int>(k / 2);
        const auto same = std::ranges::find_if(points, [&](const Point& point) {
          return point.x == at_x && point.y == at_y && (point.direction - direction).norm() <= kSame * diagonal;
        });
        numbers[k] = static_cast<std::uint8_t>(same - points.begin());
        if (same != points.end()) continue;
        points.push_back({at_x, at_y, direction});
        rays.push_back(cell.corners[k]);
      }
    }
  }
  sampler_.sample(grid_, rays);
  for (std::size_t p = 0; p < points.size(); ++p) add_sights(sampler_.at(static_cast<int>(p)), low);
  low.first_point.push_back(static_cast<std::uint32_t>(low.first_sight.size() - 1));
}

blend::LowGrid LowBandCompiler::compile(int block_row) {
  blend::LowGrid low;
  low.cell_tiles = shape_.low.cell_tiles;
  low.first_point = {0};
  low.first_sight = {0};
  for (int column = 0; column < shape_.tiles_across() / blend::GridTable::kBlockTiles; ++column) {
    add_block(column, block_row, low);
  }
  return low;
}

void append(const blend::LowGrid& row, blend::LowGrid& low) {
  if (low.first_point.empty()) {
    low.cell_tiles = row.cell_tiles;
    low.first_point = {0};
    low.first_sight = {0};
  }
  const std::uint32_t points = low.first_point.back();
  const std::uint32_t sights = low.first_sight.back();
  for (std::size_t b = 1; b < row.first_point.size(); ++b) low.first_point.push_back(points + row.first_point[b]);
  for (std::size_t p = 1; p < row.first_sight.size(); ++p) low.first_sight.push_back(sights + row.first_sight[p]);
  low.sights.insert(low.sights.end(), row.sights.begin(), row.sights.end());
  low.cells.insert(low.cells.end(), row.cells.begin(), row.cells.end());
}

}  // namespace nodal::table
