#include "stitch/table/seamed_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "protocol/base/result.h"
#include "stitch/blend/tile_math.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/append_record.h"

namespace nodal::table {
namespace {

using blend::GridTable;
using blend::kTilePixels;
using blend::Sharing;

constexpr int kPlaceBits = 7;
/// The sum of a position's shares: 2^15 along rows times 2^15 along columns.
constexpr std::int64_t kWholeShare = std::int64_t{1} << 30;
constexpr std::int32_t kWholeWeight = 1 << blend::kWeightBits;
/// Place of a pixel of the raymap that has no ray.
constexpr std::uint32_t kNoRay = GridTable::kNowhere - 1;
/// Smaller weights are left out, as by TableOptions::least_weight.
constexpr std::int32_t kMin = kWholeWeight / 1024;

/// Where a ray lies on the map, in 1 / (1 << kPlaceBits) px.
std::uint32_t place_on_map(const geometry::Ray& ray, int map_width) {
  const geometry::Angles angles = ray.angles();
  const int columns = map_width << kPlaceBits, rows = columns / 2;
  const auto u = static_cast<int>(std::floor((angles.theta / (2 * std::numbers::pi) + 0.5) * columns));
  const auto v = static_cast<int>(std::floor((angles.phi / std::numbers::pi + 0.5) * rows));
  return static_cast<std::uint32_t>((u + columns) % columns) | static_cast<std::uint32_t>(std::clamp(v, 0, rows - 1))
                                                                   << 16;
}

/// The quadratic B-spline's weights of the three samples around a position, times 2^15.
std::array<std::int64_t, 3> spline(std::int64_t place) {
  constexpr std::int64_t kHalf = 1 << (kPlaceBits - 1);
  const std::int64_t t = place % (2 * kHalf) - kHalf;
  return {(kHalf - t) * (kHalf - t), 6 * kHalf * kHalf - 2 * t * t, (kHalf + t) * (kHalf + t)};
}

/// A place's cell of the map.
std::size_t cell_of(std::uint32_t place, int map_width) {
  return static_cast<std::size_t>(place >> (16 + kPlaceBits)) * static_cast<std::size_t>(map_width) +
         ((place & 0xffff) >> kPlaceBits);
}

/// Calls visit(cell, weight of the column, weight of the row) for the 3 x 3 cells around a cell; 0, 1, 2 are the
/// weights' indices.
template <class Visit>
void for_around(int column, int row, int map_width, const Visit& visit) {
  for (std::size_t l = 0; l < 3; ++l) {
    const int y = std::clamp(row - 1 + static_cast<int>(l), 0, map_width / 2 - 1);
    for (std::size_t k = 0; k < 3; ++k) {
      const int x = (column - 1 + static_cast<int>(k) + map_width) % map_width;
      visit(static_cast<std::size_t>(y * map_width + x), k, l);
    }
  }
}

constexpr std::uint8_t kSeveral = 254;

/// For each cell, the label of all cells around it, or kSeveral.
std::vector<std::uint8_t> labels_around(SeamedTable::Labels labels, int map_width) {
  std::vector<std::uint8_t> around(labels.begin(), labels.end());
  for (int row = 0; row < map_width / 2; ++row) {
    for (int column = 0; column < map_width; ++column) {
      const auto cell = static_cast<std::size_t>(row * map_width + column);
      for_around(column, row, map_width, [&](std::size_t other, std::size_t, std::size_t) {
        if (labels[other] != labels[cell]) around[cell] = kSeveral;
      });
    }
  }
  return around;
}

/// For each cell, whether a label around it has changed; true for all cells if there were no labels before.
std::vector<bool> changed_around(SeamedTable::Labels before, SeamedTable::Labels labels, int map_width) {
  std::vector<bool> changed(labels.size(), before.empty());
  for (std::size_t cell = 0; cell < before.size(); ++cell) {
    if (before[cell] == labels[cell]) continue;
    for_around(static_cast<int>(cell) % map_width, static_cast<int>(cell) / map_width, map_width,
               [&](std::size_t other, std::size_t, std::size_t) { changed[other] = true; });
  }
  return changed;
}

/// By head.
using Parts = std::array<std::int64_t, kMaxHeads>;

/// The heads' shares of a place on the map: the labels around it, weighted.
Parts parts_at(SeamedTable::Labels labels, std::uint32_t place, int map_width) {
  Parts parts{};
  const std::array<std::int64_t, 3> across = spline(place & 0xffff), down = spline(place >> 16);
  for_around(static_cast<int>(place & 0xffff) >> kPlaceBits, static_cast<int>(place >> 16) >> kPlaceBits, map_width,
             [&](std::size_t cell, std::size_t k, std::size_t l) {
               if (labels[cell] < kMaxHeads) parts[labels[cell]] += across[k] * down[l];
             });
  return parts;
}

/// Appends a record of another grid, with its list and its gain.
void copy_record(const GridTable& from, std::size_t r, GridTable& to) {
  append_record(from.records[r], from.coordinates, to);
  if (!from.gains.empty()) to.gains.push_back(from.gains[r]);
}

/// The records of a tile in the cover, and their new weights.
struct TileWeights {
  std::size_t tile = 0, first = 0, count = 0;
  std::span<const std::uint64_t> seen;
  std::vector<blend::Weights> made;

  void begin(const GridTable& cover, std::size_t t, std::span<const std::uint64_t> all_seen) {
    tile = t;
    first = cover.tiles[t].record;
    count = cover.tiles[t + 1].record - first;
    seen = all_seen.subspan(first, count);
    made.assign(count, blend::Weights{});
  }
  bool sees(std::size_t k, std::size_t p) const { return (seen[k] >> p & 1) != 0; }
};

/// The record with the largest weight of the cover at pixel p, which some record sees.
std::size_t widest_at(const GridTable& cover, const TileWeights& tile, std::size_t p) {
  blend::WeightReader reader(cover, cover.tiles[tile.tile], tile.count);
  std::size_t widest = 0;
  std::uint16_t most = 0;
  for (std::size_t k = 0; k < tile.count; ++k) {
    blend::Weights weights;
    reader.next(weights);
    if (weights[p] <= most) continue;
    most = weights[p];
    widest = k;
  }
  return widest;
}

/// Shares pixel p out. Returns whether any head sees it.
bool share_out(const GridTable& cover, std::size_t p, const Parts& parts, std::int64_t ramp, TileWeights& tile) {
  constexpr std::size_t kNone = SIZE_MAX;
  std::size_t best = kNone;
  bool any = false;
  const auto part_of = [&](std::size_t k) {
    return tile.sees(k, p) ? parts[cover.records[tile.first + k].head()] : std::int64_t{0};
  };
  for (std::size_t k = 0; k < tile.count; ++k) {
    any = any || tile.sees(k, p);
    if (part_of(k) > (best == kNone ? 0 : part_of(best))) best = k;
  }
  if (best == kNone) {
    if (any) tile.made[widest_at(cover, tile, p)][p] = kWholeWeight;
    return any;
  }
  const auto raw = [&](std::size_t k) -> std::int64_t {
    const std::int64_t part = part_of(k), behind = part_of(best) - part;
    return part > 0 && behind < ramp ? kWholeWeight * (ramp - behind) / (ramp + behind) : 0;
  };
  std::int64_t sum = 0;
  for (std::size_t k = 0; k < tile.count; ++k) sum += raw(k);
  std::int64_t rest = kWholeWeight;
  for (std::size_t k = 0; k < tile.count; ++k) {
    const std::int64_t weight = k == best ? 0 : raw(k) * kWholeWeight / sum;
    if (weight < kMin) continue;
    tile.made[k][p] = static_cast<std::uint16_t>(weight);
    rest -= weight;
  }
  tile.made[best][p] = static_cast<std::uint16_t>(rest);
  return true;
}

/// Appends the tile's records that have any weight. `open`: a pixel inside the grid has no head.
void append(const GridTable& cover, const TileWeights& tile, bool open, GridTable& to) {
  struct Used {
    std::size_t first = 0;
    std::size_t records = 1;  ///< 2: a pair
  };
  std::vector<Used> used;
  for (Used at; at.first < tile.count; at.first += at.records) {
    at.records = cover.records[tile.first + at.first].paired() ? 2 : 1;
    const std::span made = std::span(tile.made).subspan(at.first, at.records);
    const auto any = [](const blend::Weights& of) {
      return std::ranges::any_of(of, [](auto weight) { return weight != 0; });
    };
    if (std::ranges::any_of(made, any)) used.push_back(at);
  }
  blend::Tile made{static_cast<std::uint32_t>(to.records.size()), 0};
  const bool alone = used.empty() || (used.size() == 1 && !open);
  if (!alone) {
    const Sharing how = open ? Sharing::kOpen : Sharing::kListed;
    made.sharing = static_cast<std::uint32_t>(how) << 30 | static_cast<std::uint32_t>(to.weights.size() / 4);
  }
  to.tiles.push_back(made);
  for (std::size_t i = 0; i < used.size(); ++i) {
    const Used& at = used[i];
    for (std::size_t k = 0; k < at.records; ++k) copy_record(cover, tile.first + at.first + k, to);
    if (alone || (!open && i + 1 == used.size())) continue;
    for (std::size_t p = 0; p < kTilePixels; ++p) {
      // The second of a pair has the lower half.
      const std::size_t k = at.first + (p < kTilePixels / 2 ? 0 : at.records - 1);
      to.weights.push_back(static_cast<std::int16_t>(-tile.made[k][p]));
    }
  }
}

/// Appends tile t of the table as it is.
void copy_tile(const GridTable& from, std::size_t t, GridTable& to) {
  blend::Tile tile = from.tiles[t];
  const std::size_t end = from.tiles[t + 1].record;
  if (tile.how() != Sharing::kAlone) {
    const std::size_t shares = blend::share_count(std::span(from.records).subspan(tile.record, end - tile.record));
    const std::size_t lists = tile.how() == Sharing::kOpen ? shares : shares - 1;
    const auto at = from.weights.begin() + static_cast<std::ptrdiff_t>(tile.weights());
    const std::size_t each = tile.how() == Sharing::kBilinear ? 4 : kTilePixels;
    tile.sharing = static_cast<std::uint32_t>(tile.how()) << 30 | static_cast<std::uint32_t>(to.weights.size() / 4);
    to.weights.insert(to.weights.end(), at, at + static_cast<std::ptrdiff_t>(lists * each));
  }
  const std::size_t first = from.tiles[t].record;
  tile.record = static_cast<std::uint32_t>(to.records.size());
  to.tiles.push_back(tile);
  for (std::size_t r = first; r < end; ++r) copy_record(from, r, to);
}

}  // namespace

SeamedTable::SeamedTable(const blend::BlendTable& table, const geometry::RaymapLayout& layout, int map_width,
                         double seam_width_deg)
    : map_width_(map_width) {
  NODAL_ASSERT(table.cover.size() == table.grids.size());
  NODAL_ASSERT(map_width >= 4 && map_width <= kMaxColumns && map_width % 2 == 0);
  // Across a straight seam the difference of two shares changes by 3/2 a pixel of the map.
  const double ramp = seam_width_deg / 360 * map_width * 0.75;
  ramp_ = std::clamp<std::int64_t>(std::llround(ramp * static_cast<double>(kWholeShare)), 1, kWholeShare);
  for (std::size_t g = 0; g < table.grids.size(); ++g) {
    const GridTable &own = table.grids[g], &cover = table.cover[g];
    const PlaneGrid plane = component_grid(table.format, g == 0 ? 0 : 1);
    Grid& made = grids_.emplace_back();
    made.first.assign(own.tile_count(), kOneHead);
    for (int row = 0; row < own.tiles_down(); ++row) {
      for (int column = 0; column < own.tiles_across(); ++column) {
        const std::size_t t = own.tile_index(column, row);
        if (cover.tiles[t].record == cover.tiles[t + 1].record) continue;
        made.first[t] = static_cast<std::uint32_t>(made.places.size());
        for (int p = 0; p < kTilePixels; ++p) {
          int x = column * blend::kTile + p % blend::kTile, y = row * blend::kTile + p / blend::kTile;
          std::uint32_t place = GridTable::kNowhere;
          if (x < own.width && y < own.height) {
            if (!own.places.empty()) {
              const std::uint32_t at = own.places[t * kTilePixels + static_cast<std::size_t>(p)];
              x = static_cast<int>(at & 0xffff);
              y = static_cast<int>(at >> 16);
            }
            const auto ray = layout.ray(std::min<double>(table.width, (x + 0.5 - plane.offset_x) * plane.step_x),
                                        std::min<double>(table.height, (y + 0.5 - plane.offset_y) * plane.step_y));
            place = ray ? place_on_map(*ray, map_width) : kNoRay;
          }
          made.places.push_back(place);
        }
      }
    }
    made.places.shrink_to_fit();
    for (std::size_t t = 0; t < cover.tile_count(); ++t) {
      blend::Weights weights;
      const std::size_t count = cover.tiles[t + 1].record - cover.tiles[t].record;
      blend::WeightReader reader(cover, cover.tiles[t], count);
      for (std::size_t k = 0; k < count; ++k) {
        reader.next(weights);
        std::uint64_t& seen = made.seen.emplace_back(0);
        for (std::size_t p = 0; p < kTilePixels; ++p) seen |= std::uint64_t{weights[p] != 0} << p;
      }
    }
  }
}

SeamedTable::Moved SeamedTable::with(const blend::BlendTable& table, Labels before, Labels labels) const {
  const std::vector<bool> changed = changed_around(before, labels, map_width_);
  const std::vector<std::uint8_t> around = labels_around(labels, map_width_);
  Moved moved{{table.format,
               table.width,
               table.height,
               table.sources,
               {},
               table.cover,
               table.components,
               table.vignetting_scale,
               table.linear},
              {}};
  for (std::size_t g = 0; g < grids_.size(); ++g) {
    const Grid& grid = grids_[g];
    std::vector<bool>& made = moved.made.emplace_back(grid.first.size());
    for (std::size_t t = 0; t < grid.first.size(); ++t) {
      if (grid.first[t] == kOneHead) continue;
      const std::span places = std::span(grid.places).subspan(grid.first[t], kTilePixels);
      made[t] = std::ranges::any_of(
          places, [&](std::uint32_t place) { return place < kNoRay && changed[cell_of(place, map_width_)]; });
    }
    moved.table.grids.push_back(with(table.grids[g], table.cover[g], grid, labels, around, made));
  }
  return moved;
}

blend::GridTable SeamedTable::with(const GridTable& own, const GridTable& cover, const Grid& grid, Labels labels,
                                   const std::vector<std::uint8_t>& around, const std::vector<bool>& made) const {
  GridTable to;
  to.width = own.width;
  to.height = own.height;
  to.row_step = own.row_step;
  to.places = own.places;
  to.batches = own.batches;
  to.runs = own.runs;
  to.slots = own.slots;
  to.low = own.low;
  to.tiles.reserve(own.tiles.size());
  to.records.reserve(own.records.size() + own.records.size() / 8);
  to.weights.reserve(own.weights.size() + own.weights.size() / 8);
  to.coordinates.reserve(own.coordinates.size() + own.coordinates.size() / 8);
  TileWeights weights;
  for (std::size_t t = 0; t < own.tile_count(); ++t) {
    if (!made[t]) {
      copy_tile(own, t, to);
      continue;
    }
    weights.begin(cover, t, grid.seen);
    bool open = false;
    for (std::size_t p = 0; p < kTilePixels; ++p) {
      const std::uint32_t place = grid.places[grid.first[t] + p];
      if (place == GridTable::kNowhere) continue;
      if (place == kNoRay) {
        open = true;
        continue;
      }
      const std::uint8_t label = around[cell_of(place, map_width_)];
      Parts parts{};
      if (label < kMaxHeads) parts[label] = kWholeShare;
      else if (label == kSeveral) parts = parts_at(labels, place, map_width_);
      if (!share_out(cover, p, parts, ramp_, weights)) open = true;
    }
    append(cover, weights, open, to);
  }
  to.tiles.push_back({static_cast<std::uint32_t>(to.records.size()), 0});
  return to;
}

}  // namespace nodal::table
