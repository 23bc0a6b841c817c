#include "stitch/table/validate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/try.h"
#include "stitch/table/batches.h"
#include "stitch/table/made_rows.h"

namespace nodal::table {
namespace {

using blend::BlendTable;
using blend::GridTable;
using blend::PatchRecord;
using blend::Sharing;
using blend::Tile;

tl::unexpected<Error> invalid(const std::string& what) {
  return fail(Errc::kTableInvalid, "blend table: " + what + "; compile it again from the calibration");
}

ImageView shape_of(PixelFormat format, int width, int height) {
  return packed_image(format, width, height, static_cast<const std::uint8_t*>(nullptr));
}

/// The numbers of all lights are present, and that of zero light is 0.
bool is_good_linear(const BlendTable& table) {
  if (!is_linear16(table.format)) return table.linear.empty();
  return table.linear.size() == blend::kLinearSteps && table.linear[0] == 0 && std::ranges::is_sorted(table.linear);
}

Status check_shape(const BlendTable& table) {
  if (!is_raymap_format(table.format)) {
    return invalid("raymap format " + std::string(pixel_format_name(table.format)) + " is none it can have");
  }
  if (table.width < 1 || table.height < 1 || table.width > 65535 || table.height > 65535) {
    return invalid(fmt::format("raymap of {} x {}", table.width, table.height));
  }
  if (!is_good_linear(table)) return invalid("numbers of linear light");
  if (table.vignetting_scale < 256 || table.vignetting_scale > 2048) {
    return invalid(fmt::format("vignetting scale {}", table.vignetting_scale));
  }
  if (table.sources.empty() || table.sources.size() > kMaxHeads) {
    return invalid(fmt::format("{} heads, not 1 to {}", table.sources.size(), kMaxHeads));
  }
  for (std::size_t h = 0; h < table.sources.size(); ++h) {
    const BlendTable::Source& source = table.sources[h];
    const std::string head = fmt::format("head {}: ", h);
    const bool fits = has_chroma(table.format) ? has_chroma(source.format) : source.format == in_8_bits(table.format);
    if (!fits) return invalid(head + "format does not fit the raymap's");
    if (source.width < 4 || source.height < 4 || source.width > 65535 || source.height > 65535) {
      return invalid(fmt::format("{}{} x {} px", head, source.width, source.height));
    }
    for (const std::uint16_t gain : source.gain) {
      if (gain < 1 || gain > blend::kMaxGain) return invalid(fmt::format("{}gain {}", head, gain));
    }
    if (source.levels < 1 || source.levels > blend::kMaxLevels) {
      return invalid(fmt::format("{}{} levels", head, source.levels));
    }
    const bool low_ok =
        source.low_size == 0 || (source.low_size >= blend::kMinLowSize && source.low_size <= blend::kMaxLowSize &&
                                 std::has_single_bit(source.low_size));
    if (!low_ok) return invalid(fmt::format("{}low picture of squares of {}", head, source.low_size));
    if (source.sharpen > blend::kMaxSharpen) return invalid(fmt::format("{}sharpening {}", head, source.sharpen));
  }
  return {};
}

/// Components that share a grid must be those that share it in the format, so that every plane's samples are written.
Status check_components(const BlendTable& table) {
  const bool chroma = has_chroma(table.format);
  if (table.grids.size() != (chroma ? 2U : 1U)) return invalid(fmt::format("{} grids", table.grids.size()));
  const ImageView raymap = shape_of(table.format, table.width, table.height);
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(table.format)); ++c) {
    const blend::ComponentRule& rule = table.components[c];
    const std::size_t expected = chroma && c > 0 ? 1 : 0;
    // A tone class has one black.
    const bool other_black =
        std::ranges::any_of(std::span(table.components).first(static_cast<std::size_t>(component_count(table.format))),
                            [&](const auto& other) { return other.tone == rule.tone && other.black != rule.black; });
    if (rule.grid != expected || rule.tone > 2 || other_black) return invalid(fmt::format("rule of component {}", c));
    const GridTable& grid = table.grids[expected];
    const int step = expected == 1 ? 2 : 1;
    if (grid.width != raymap.planes[c].width || grid.height != raymap.planes[c].height || grid.row_step != step) {
      return invalid(fmt::format("grid {} does not have its component's size", expected));
    }
  }
  return {};
}

/// Validates one grid, of the table's own or of its cover.
class GridProof {
 public:
  GridProof(const BlendTable& table, const GridTable& grid, std::size_t g, const std::string& kind)
      : table_(table),
        grid_(grid),
        components_(components_on(table.format, static_cast<int>(g))),
        where_(fmt::format("{} {}", kind, g)) {
    for (std::size_t h = 0; h < table.sources.size(); ++h) {
      const BlendTable::Source& source = table.sources[h];
      planes_[h] = halved_chroma(shape_of(source.format, source.width, source.height)).planes[g];
    }
  }

  /// All tiles, or only some.
  Status run(const std::vector<bool>* only = nullptr) {
    if (grid_.tiles.size() != grid_.tile_count() + 1)
      return invalid(where_ + ": there is not one tile more than it has");
    if (grid_.tiles.front().record != 0) return invalid(where_ + ": its tiles do not begin with the first record");
    if (grid_.tiles.back().record != grid_.records.size()) {
      return invalid(where_ + ": its tiles do not end with the last record");
    }
    if (!grid_.gains.empty() && grid_.gains.size() != grid_.records.size()) {
      return invalid(where_ + ": there is not one gain a record");
    }
    if (grid_.coordinates.size() % (2 * blend::kTilePixels) != 0) return invalid(where_ + ": a list is cut short");
    if (only == nullptr) {
      if (const char* fault = fault_of_places(grid_, components_)) return invalid(where_ + ": " + fault);
    }
    for (int row = 0; row < grid_.tiles_down(); ++row) {
      for (int column = 0; column < grid_.tiles_across(); ++column) {
        if (only != nullptr && !(*only)[grid_.tile_index(column, row)]) continue;
        if (const char* fault = fault_of_tile(column, row)) {
          return invalid(fmt::format("{}, tile ({}, {}): {}", where_, column, row, fault));
        }
      }
    }
    return {};
  }

 private:
  using Weights = std::array<std::int32_t, blend::kTilePixels>;

  /// What is wrong with a tile; null: nothing.
  const char* fault_of_tile(int column, int row) {
    const std::size_t t = grid_.tile_index(column, row);
    const Tile& tile = grid_.tiles[t];
    const std::size_t end = grid_.tiles[t + 1].record;
    if (end < tile.record || end > grid_.records.size()) return "its records fall or run past the last";
    const std::size_t records = end - tile.record;
    const std::span of_tile = std::span(grid_.records).subspan(tile.record, records);
    if (const char* fault = fault_of_pairs(of_tile)) return fault;
    const Sharing how = tile.how();
    const std::size_t shares = blend::share_count(of_tile);
    if (how == Sharing::kAlone && shares > 1) return "several records say that they are alone";
    const std::size_t shared = how == Sharing::kOpen ? shares : shares == 0 ? 0 : shares - 1;
    const std::size_t each = how == Sharing::kAlone ? 0 : how == Sharing::kBilinear ? 4 : blend::kTilePixels;
    if (tile.weights() + shared * each > grid_.weights.size()) return "its weights run past the last";
    inside_x_ = std::min(blend::kTile, grid_.width - column * blend::kTile);
    inside_y_ = std::min(blend::kTile, grid_.height - row * blend::kTile);
    Weights rest;
    rest.fill(1 << blend::kWeightBits);
    const std::int16_t* at = grid_.weights.data() + tile.weights();
    for (std::size_t k = 0, share = 0; k < records; ++share, at += each) {
      const bool given = share < shared;
      Weights weights = rest;
      for (std::size_t p = 0; p < blend::kTilePixels && given; ++p) {
        const int i = static_cast<int>(p % blend::kTile);
        const int j = static_cast<int>(p / blend::kTile);
        weights[p] = how == Sharing::kBilinear ? -(at[0] + at[1] * i + at[2] * j + at[3] * i * j) : -at[p];
      }
      for (const std::size_t next = k + (of_tile[k].paired() ? 2 : 1); k < next; ++k) {
        if (const char* fault = fault_of_record(of_tile[k], tile.record + k, weights)) return fault;
      }
      for (std::size_t p = 0; p < blend::kTilePixels && given; ++p) rest[p] -= weights[p];
    }
    return fault_of_sums(how, records, rest);
  }

  /// Whether two records can be a pair, but for the rows that they name.
  static bool match(const PatchRecord& upper, const PatchRecord& lower) {
    if (upper.source != lower.source) return false;
    if (upper.listed()) return upper.list() == lower.list();
    blend::Quadratic x = upper.x, y = upper.y;
    x[0] = blend::moved(x[0], lower.left - upper.left);
    y[0] = blend::moved(y[0], lower.top - upper.top);
    return x == lower.x && y == lower.y;
  }

  static const char* fault_of_pairs(std::span<const PatchRecord> records) {
    const PatchRecord* upper = nullptr;
    for (const PatchRecord& record : records) {
      if (record.has(0) == (upper != nullptr) || (upper != nullptr && !record.has(1))) return "has half a pair";
      if (upper != nullptr && !match(*upper, record)) return "has a pair of records that do not match";
      upper = record.paired() ? &record : nullptr;
    }
    return upper != nullptr ? "has half a pair" : nullptr;
  }

  template <class Each>
  const char* each_pixel(Each fault_at) const {
    for (int j = 0; j < inside_y_; ++j) {
      for (int i = 0; i < inside_x_; ++i) {
        if (const char* fault = fault_at(i, j)) return fault;
      }
    }
    return nullptr;
  }

  const char* fault_of_sums(Sharing how, std::size_t records, const Weights& rest) const {
    if (how != Sharing::kOpen || records == 0)
      return nullptr;  // the last record's weight is one minus the sum of the others
    return each_pixel([&](int i, int j) -> const char* {
      const std::int32_t left = rest[static_cast<std::size_t>(j * blend::kTile + i)];
      return left == 0 || left == 1 << blend::kWeightBits ? nullptr : "weights sum to neither one nor nothing";
    });
  }

  const char* fault_of_record(const PatchRecord& record, std::size_t r, const Weights& weights) const {
    if (record.head() >= table_.sources.size()) return "names a head that is not there";
    const int level = record.pyramid_level();
    if (level >= table_.sources[record.head()].levels) return "names a level that its head does not have";
    const int width = planes_[record.head()].width >> level;
    const int height = planes_[record.head()].height >> level;
    const bool small = std::min(width, height) <
                       blend::kPatch;  // then it is read sample by sample, and the patch may extend beyond the plane
    if (small ? record.left >= width || record.top >= height
              : record.left + blend::kPatch > width || record.top + blend::kPatch > height) {
      return "has a patch outside its head's picture";
    }
    if (record.last_row() > blend::kPatch - 2 || record.span() < blend::kMinSpan) return "has rows beyond its patch";
    for (std::size_t quarter = 0; quarter < 4; ++quarter) {
      if (!record.has(quarter / 2)) continue;
      if (record.first_row(quarter / 2, quarter % 2) + record.span() > blend::kPatch - 1)
        return "has rows beyond its patch";
    }
    if (record.listed() && record.list() >= grid_.coordinates.size() / (2 * blend::kTilePixels)) {
      return "names a list that is not there";
    }
    return each_pixel([&](int i, int j) -> const char* {
      if (!record.has(static_cast<std::size_t>(j / blend::kQuarter))) return nullptr;
      const std::int32_t weight = weights[static_cast<std::size_t>(j * blend::kTile + i)];
      if (weight < 0 || weight > 1 << blend::kWeightBits) return "has a weight of less than nothing or more than one";
      return weight == 0 ? nullptr : fault_of_pixel(record, r, i, j, width, height);
    });
  }

  const char* fault_of_pixel(const PatchRecord& record, std::size_t r, int i, int j, int width, int height) const {
    const auto quadratic = [&](const blend::Quadratic& q) {
      return static_cast<std::uint16_t>(q[0] + q[1] * i + q[2] * j + q[3] * i * j + q[4] * i * i + q[5] * j * j);
    };
    int x = 0;
    int y = 0;
    if (record.listed()) {
      const auto p = static_cast<std::size_t>(j * blend::kTile + i);
      x = grid_.coordinates[record.list() * 2 * blend::kTilePixels + p] >> blend::kFractionBits;
      y = grid_.coordinates[(record.list() * 2 + 1) * blend::kTilePixels + p] >> blend::kFractionBits;
    } else {
      x = quadratic(record.x) >> blend::kFractionBits;
      y = quadratic(record.y) >> blend::kFractionBits;
    }
    if (x > blend::kPatch - 2 || y > blend::kPatch - 2) return "has a pixel at its patch's edge";
    if (record.left + x + 1 >= width || record.top + y + 1 >= height) return "reads outside its head's picture";
    const auto half = static_cast<std::size_t>(j / blend::kQuarter);
    const int first = record.first_row(half, static_cast<std::size_t>(i / blend::kQuarter));
    if (y < first || y >= first + record.span() || y > record.last_row()) {
      return "has a pixel in a row that it does not name";
    }
    if (grid_.gains.empty()) return nullptr;
    const auto& g = grid_.gains[r];
    const std::int32_t gain = g[0] + g[1] * i + g[2] * j + g[3] * i * j;
    return gain < 1 || gain > 32767 ? "has a gain out of range" : nullptr;
  }

  const BlendTable& table_;
  const GridTable& grid_;
  std::size_t components_;
  std::string where_;
  std::array<PlaneView, kMaxHeads> planes_;
  int inside_x_ = 0;  ///< columns of the current tile that are inside the grid
  int inside_y_ = 0;
};

/// Whether `first` divides `count` things into `parts`, one after the other, each of `most` at most.
bool divides(const std::vector<std::uint32_t>& first, std::size_t parts, std::size_t count, std::size_t most) {
  if (first.size() != parts + 1 || first.front() != 0 || first.back() != count) return false;
  for (std::size_t k = 0; k < parts; ++k) {
    if (first[k + 1] < first[k] || first[k + 1] - first[k] > most) return false;
  }
  return true;
}

/// Nothing, or the fault of a point.
const char* fault_of_point(const BlendTable& table, const GridTable& grid, std::size_t g, std::size_t point) {
  const blend::LowGrid& low = grid.low;
  std::uint32_t sum = 0;
  std::uint32_t heads = 0;
  for (std::size_t s = low.first_sight[point]; s < low.first_sight[point + 1]; ++s) {
    const blend::LowSight& sight = low.sights[s];
    if (sight.head >= table.sources.size()) return "names a head that is not there";
    const BlendTable::Source& source = table.sources[sight.head];
    if (source.low_size == 0) return "names a head that has no low picture";
    if ((heads >> sight.head & 1) != 0) return "names a head twice";
    heads |= 1U << sight.head;
    const PlaneView plane = halved_chroma(shape_of(source.format, source.width, source.height)).planes[g];
    const int square = g == 0 ? source.low_size : source.low_size / 2;
    if (sight.x > (std::max(1, plane.width / square) - 1) * 256 ||
        sight.y > (std::max(1, plane.height / square) - 1) * 256) {
      return "reads outside its head's low picture";
    }
    if (grid.gains.empty() ? sight.gain != 0 : sight.gain < 1) return "has a gain out of range";
    sum += sight.weight;
  }
  return heads == 0 || sum == 1U << blend::kWeightBits ? nullptr : "has weights that do not sum to one";
}

/// Checks that all grids have a LowGrid, or none, and that each is sound.
Status check_low(const BlendTable& table) {
  for (std::size_t g = 0; g < table.grids.size(); ++g) {
    const GridTable& grid = table.grids[g];
    const blend::LowGrid& low = grid.low;
    const std::string where = fmt::format("low band of grid {}", g);
    if (low.cells.empty() != table.grids[0].low.cells.empty()) return invalid(where + " is missing");
    if (low.cells.empty()) continue;
    if (low.cell_tiles != 1 && low.cell_tiles != 2)
      return invalid(fmt::format("{}: cells of {} tiles", where, low.cell_tiles));
    const std::size_t blocks = grid.block_count();
    const std::size_t points = low.first_sight.empty() ? 0 : low.first_sight.size() - 1;
    const auto cells = static_cast<std::size_t>(grid.low_cells_across() * grid.low_cells_down());
    if (!divides(low.first_point, blocks, points, GridTable::kMaxLowPoints))
      return invalid(where + ": points of blocks");
    if (!divides(low.first_sight, points, low.sights.size(), kMaxHeads)) return invalid(where + ": sights of points");
    if (low.cells.size() != blocks * cells) return invalid(where + ": there is not one entry a cell");
    for (std::size_t k = 0; k < low.cells.size(); ++k) {
      const std::uint32_t count = low.first_point[k / cells + 1] - low.first_point[k / cells];
      if (std::ranges::any_of(low.cells[k], [&](std::uint8_t point) { return point >= count; })) {
        return invalid(fmt::format("{}, cell {}: names a point that is not there", where, k));
      }
    }
    for (std::size_t p = 0; p < points; ++p) {
      if (const char* fault = fault_of_point(table, grid, g, p)) {
        return invalid(fmt::format("{}, point {}: {}", where, p, fault));
      }
    }
  }
  return {};
}

/// A cover has tiles where the table has them, and no places of its own.
Status check_cover(const BlendTable& table) {
  if (!table.cover.empty() && table.cover.size() != table.grids.size()) {
    return invalid(fmt::format("{} covers for {} grids", table.cover.size(), table.grids.size()));
  }
  for (std::size_t g = 0; g < table.cover.size(); ++g) {
    const GridTable& cover = table.cover[g];
    const GridTable& grid = table.grids[g];
    const std::string where = fmt::format("cover {}", g);
    if (cover.width != grid.width || cover.height != grid.height || cover.row_step != grid.row_step) {
      return invalid(where + " does not have its grid's size");
    }
    if (!cover.records.empty() && cover.gains.empty() != grid.gains.empty()) return invalid(where + ": gains");
    if (!cover.places.empty()) return invalid(where + " has places of its own");
    NODAL_TRY(GridProof(table, cover, g, "cover").run());
  }
  return {};
}

}  // namespace

Status validate_blend_table(const BlendTable& table) {
  NODAL_TRY(check_shape(table));
  NODAL_TRY(check_components(table));
  for (std::size_t g = 0; g < table.grids.size(); ++g) {
    NODAL_TRY(GridProof(table, table.grids[g], g, "grid").run());
  }
  NODAL_TRY(check_cover(table));
  if (!all_read_is_made(table)) return invalid("a patch reads a part of a halved picture that is not made");
  return check_low(table);
}

Status validate_tiles(const BlendTable& table, const std::vector<std::vector<bool>>& tiles) {
  for (std::size_t g = 0; g < table.grids.size(); ++g) {
    NODAL_TRY(GridProof(table, table.grids[g], g, "grid").run(&tiles[g]));
  }
  return {};
}

}  // namespace nodal::table
