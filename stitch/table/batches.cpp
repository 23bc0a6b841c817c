#include "stitch/table/batches.h"

#include <algorithm>
#include <vector>

namespace nodal::table {
namespace {

using blend::GridTable;
using blend::kTilePixels;

constexpr std::size_t kStrip = GridTable::kBlockTiles * kTilePixels;

/// With shorter runs on average, pixels are written one by one.
constexpr std::size_t kMinRun = 4;
constexpr std::size_t kLongRun = 32;

/// The first strip of each batch, and the end. A batch has as many whole cells as fit into `most` strips, or one cell
/// that fits into `limit` strips, or `most` strips where there are no cells.
std::vector<std::uint32_t> first_strips(const GridTable& grid, std::size_t most, std::size_t limit,
                                        std::span<const std::uint32_t> cells) {
  const auto strips = static_cast<std::uint32_t>(grid.tile_count() / GridTable::kBlockTiles);
  std::vector<std::uint32_t> first{0};
  const auto cell_until = [&](std::size_t strip) -> std::uint32_t {  // the last that begins until then, 0 for none
    const auto beyond = std::ranges::upper_bound(cells, strip * GridTable::kBlockTiles);
    return beyond == cells.begin() ? 0 : *(beyond - 1) / GridTable::kBlockTiles;
  };
  while (first.back() + most < strips) {
    const std::uint32_t begin = first.back();
    std::uint32_t end = cell_until(begin + most);
    if (end <= begin) end = cell_until(begin + limit);
    first.push_back(end > begin ? end : static_cast<std::uint32_t>(begin + most));
  }
  first.push_back(strips);
  return first;
}

struct Blended {
  std::uint32_t place = 0;
  std::uint16_t slot = 0;
};

void clear(GridTable& grid) {
  grid.batches = {};
  grid.runs = {};
  grid.slots = {};
}

/// Appends a batch of the strips from `begin` to `end`.
void add_batch(GridTable& grid, std::size_t begin, std::size_t end, std::size_t components) {
  std::vector<Blended> pixels;
  for (std::size_t t = begin * GridTable::kBlockTiles; t < end * GridTable::kBlockTiles; ++t) {
    const std::size_t tile =
        GridTable::slot(t / GridTable::kBlockTiles - begin, t % GridTable::kBlockTiles, 0, components);
    for (std::size_t p = 0; p < kTilePixels; ++p) {
      const std::uint32_t place = grid.places[t * kTilePixels + p];
      if (place != GridTable::kNowhere) pixels.push_back({place, static_cast<std::uint16_t>(tile + p)});
    }
  }
  std::ranges::sort(pixels, {}, &Blended::place);
  std::vector<std::span<const Blended>> runs;
  for (auto from = pixels.cbegin(); from != pixels.cend();) {
    const auto to = std::adjacent_find(
        from, pixels.cend(), [](const Blended& left, const Blended& right) { return right.place != left.place + 1; });
    const auto past = to == pixels.cend() ? to : to + 1;
    runs.emplace_back(from, past);
    from = past;
  }
  // Runs that begin near each other in the buffer go on near each other, too, if the layout's order is regular.
  std::ranges::sort(runs, {}, [](std::span<const Blended> run) { return run.front().slot; });
  grid.batches.push_back({static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(grid.runs.size())});
  for (const std::span<const Blended> run : runs) {
    grid.runs.push_back({run.front().place, static_cast<std::uint32_t>(grid.slots.size())});
    for (const Blended& pixel : run) grid.slots.push_back(pixel.slot);
  }
}

bool places_are_every_pixel(const GridTable& grid) {
  if (grid.places.size() != grid.tile_count() * kTilePixels) return false;
  std::vector<bool> seen(static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height), false);
  for (int row = 0; row < grid.tiles_down() * blend::kTile; ++row) {
    for (int column = 0; column < grid.tiles_across() * blend::kTile; ++column) {
      const std::size_t t = grid.tile_index(column / blend::kTile, row / blend::kTile);
      const std::uint32_t place =
          grid.places[t * kTilePixels +
                      static_cast<std::size_t>(row % blend::kTile * blend::kTile + column % blend::kTile)];
      const bool inside = column < grid.width && row < grid.height;
      if (inside != (place != GridTable::kNowhere)) return false;
      if (!inside) continue;
      const std::size_t x = place & 0xffff;
      const std::size_t y = place >> 16;
      if (x >= static_cast<std::size_t>(grid.width) || y >= static_cast<std::size_t>(grid.height)) return false;
      const std::size_t at = y * static_cast<std::size_t>(grid.width) + x;
      if (seen[at]) return false;
      seen[at] = true;
    }
  }
  return true;  // the right number, and none twice
}

/// What is wrong with the batches of a grid whose places are proven; null: nothing.
const char* fault_of_batches(const GridTable& grid, std::size_t components) {
  const std::size_t strips = grid.tile_count() / GridTable::kBlockTiles;
  if (grid.batches.size() < 2 || grid.batches.front().strip != 0 || grid.batches.front().run != 0 ||
      grid.batches.back().strip != strips || grid.batches.back().run + std::size_t{1} != grid.runs.size()) {
    return "its batches are not all of its tiles and runs";
  }
  if (grid.slots.size() != static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height) ||
      grid.runs.front().slot != 0 || grid.runs.back().slot != grid.slots.size()) {
    return "its runs are not all of its pixels";
  }
  std::vector<bool> written(grid.places.size(), false);
  for (std::size_t b = 0; b + 1 < grid.batches.size(); ++b) {
    const GridTable::Batch &batch = grid.batches[b], &next = grid.batches[b + 1];
    if (next.strip <= batch.strip || next.strip > strips || next.run < batch.run || next.run >= grid.runs.size()) {
      return "its batches are not in order";
    }
    if (next.strip - batch.strip > GridTable::most_strips(components)) return "a batch is larger than its buffer";
    for (std::size_t r = batch.run; r < next.run; ++r) {
      const GridTable::Run run = grid.runs[r];
      const std::uint32_t end = grid.runs[r + 1].slot;
      if (end <= run.slot || end > grid.slots.size()) return "its runs are not in order";
      for (std::size_t s = run.slot; s < end; ++s) {
        const std::size_t strip = grid.slots[s] / (components * kStrip);  // slot() backwards
        const std::size_t in_strip = grid.slots[s] % (components * kStrip);
        const std::size_t pixel = (batch.strip + strip) * kStrip + in_strip;
        if (in_strip >= kStrip || pixel >= next.strip * kStrip) {
          return "a run has a pixel that is not in its batch";
        }
        const std::uint32_t place = grid.places[pixel];
        if (place == GridTable::kNowhere || place != run.place + (s - run.slot)) {
          return "a run has a pixel that is at another place";
        }
        if (written[pixel]) return "a pixel is in two runs";
        written[pixel] = true;
      }
    }
  }
  return nullptr;  // the right number, none twice
}

}  // namespace

std::size_t components_on(PixelFormat raymap, int grid) {
  if (has_chroma(raymap)) return grid == 0 ? 1 : 2;
  return static_cast<std::size_t>(component_count(raymap));
}

void add_batches(GridTable& grid, std::size_t components, std::span<const std::uint32_t> cells) {
  if (grid.places.empty()) return;
  // Half the buffer is in or near the level-1 cache. Only if runs are then not long, they gain more by the whole
  // buffer.
  const std::size_t limit = GridTable::most_strips(components);
  for (const std::size_t most : {limit / 2, limit}) {
    clear(grid);
    grid.slots.reserve(static_cast<std::size_t>(grid.width) * static_cast<std::size_t>(grid.height));
    const std::vector<std::uint32_t> first = first_strips(grid, most, limit, cells);
    for (std::size_t b = 0; b + 1 < first.size(); ++b) add_batch(grid, first[b], first[b + 1], components);
    grid.batches.push_back({first.back(), static_cast<std::uint32_t>(grid.runs.size())});
    grid.runs.push_back({GridTable::kNowhere, static_cast<std::uint32_t>(grid.slots.size())});
    if (grid.slots.size() >= kLongRun * grid.runs.size()) break;
  }
  if (grid.slots.size() < kMinRun * grid.runs.size()) clear(grid);
  grid.batches.shrink_to_fit();
  grid.runs.shrink_to_fit();
}

const char* fault_of_places(const GridTable& grid, std::size_t components) {
  if (!grid.places.empty() && !places_are_every_pixel(grid)) return "its tiles' pixels are not every pixel once";
  if (grid.batches.empty() && grid.runs.empty() && grid.slots.empty()) return nullptr;
  return grid.places.empty() ? "it has batches but no places" : fault_of_batches(grid, components);
}

}  // namespace nodal::table
