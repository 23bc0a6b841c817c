// The loop of blend_rows over its tiles, the same for every kernel. Internal to stitch/blend; in an unnamed namespace
// for the reason given in tile_math.h. A kernel is a type with
//
//   template <int N, class Number> static void tile(const BlendJob&, const Tile&, std::size_t records, Number* out);
//     blends N components of a tile that has no missing head, component c at out + c * kStrip, row by row: levels
//     (std::uint8_t), or, for 16-bit raymaps, light (std::int16_t);
//   template <int N> static void samples(const BlendJob&, const GridTable&, const PatchRecord&,
//                                        std::array<TileValues, N>&);
//     computes the samples of the pixels with weight of a record of that table, before curve and gain;
//   template <int N> static bool emit(const BlendJob&, int x, int y, const std::uint8_t* strip, const RowEnds&);
//     writes a whole strip to the raymap at (x, y), or returns false and leaves that to write_strip;
//   static void put(std::uint8_t* to, const std::uint8_t* from, std::size_t bytes);
//     copies bytes that will not be read again soon.
#pragma once

#include "stitch/blend/scatter.h"
#include "stitch/blend/tile_math.h"

namespace nodal::blend {
namespace {

/// Strips that emit() writes follow each other from left to right: a kernel may keep the end of a row, up to 64 bytes,
/// until the strip to the right completes its cache line.
struct RowEnds {
  static constexpr std::size_t kBytes = 64;
  std::uint8_t* of;       ///< kBytes for each row of the strip, component by component; aligned
  bool leftmost = true;   ///< nothing is kept from the left
  bool rightmost = true;  ///< nothing can be left to the right: its strip, if there is one, is not whole
};

/// Whether the raymap is interleaved R G B R G B ..
inline bool interleaved(const BlendJob& job) {
  const auto& out = job.out;
  return out[0].pixel_stride == 3 && out[1].data == out[0].data + 1 && out[2].data == out[0].data + 2;
}

/// Whether the raymap is interleaved U V U V ..
inline bool paired(const BlendJob& job) {
  return job.out[0].pixel_stride == 2 && job.out[1].pixel_stride == 2 && job.out[1].data == job.out[0].data + 1;
}

/// Converts one component's light of a tile to what the strip stores: levels, or the light itself.
inline void finish_tile(const BlendJob& job, std::size_t c, const TileValues& light, std::uint8_t* out) {
  for (std::size_t j = 0; j < kTile; ++j) {
    for (std::size_t i = 0; i < kTile; ++i) out[j * kTile + i] = level_of(job, c, light[j * kTile + i]);
  }
}
inline void finish_tile(const BlendJob&, std::size_t, const TileValues& light, std::int16_t* out) {
  std::copy(light.begin(), light.end(), out);
}

/// A tile of one of the two tables that a careful blend reads: the grid's own, or its cover.
struct TileRecords {
  const GridTable& grid;
  const Tile& tile;
  std::size_t count;

  TileRecords(const GridTable& of, std::size_t t)
      : grid(of), tile(of.tiles[t]), count(of.tiles[t + 1].record - of.tiles[t].record) {}
  bool shared() const { return share_count(std::span(grid.records).subspan(tile.record, count)) > 1; }
};

/// Whether a record of the tile is of a missing head, which must not be read.
inline bool any_missing(const BlendJob& job, const TileRecords& of) {
  if (job.missing == 0) return false;
  for (std::size_t r = of.tile.record; r < of.tile.record + of.count; ++r) {
    if ((job.missing >> of.grid.records[r].head() & 1) != 0) return true;
  }
  return false;
}

/// By pixel: the sum of the weights of a tile's records, and of the products with the confidence in their heads.
struct WeightSums {
  std::array<std::uint32_t, kTilePixels> all{};
  std::array<std::uint32_t, kTilePixels> trusted{};
};

/// Calls `use(r, samples, weight, trusted weight)` for every record of the tile whose head is there.
template <class Kernel, int N, class Use>
void each_trusted(const BlendJob& job, const TileRecords& of, bool needs_samples, Use use) {
  std::array<TileValues, N> samples;
  Weights weights;
  std::array<std::uint8_t, kTilePixels> trusted;
  WeightReader reader(of.grid, of.tile, of.count);
  for (std::size_t r = of.tile.record; r < of.tile.record + of.count; ++r) {
    const PatchRecord& record = of.grid.records[r];
    reader.next(weights);
    const bool missing = (job.missing >> record.head() & 1) != 0;
    trusted.fill(missing ? 0 : 1);
    if (!missing && (job.careful || needs_samples)) Kernel::template samples<N>(job, of.grid, record, samples);
    if (!missing && job.careful) trust(job, of.grid, record, samples, trusted);
    use(r, samples, weights, trusted);
  }
}

template <class Kernel, int N>
WeightSums sums_of(const BlendJob& job, const TileRecords& of) {
  WeightSums sums;
  each_trusted<Kernel, N>(job, of, false, [&](std::size_t, const auto&, const Weights& weights, const auto& trusted) {
    for (std::size_t p = 0; p < kTilePixels; ++p) {
      sums.all[p] += weights[p];
      sums.trusted[p] += weights[p] * std::uint32_t{trusted[p]};
    }
  });
  return sums;
}

/// By pixel: what a trusted weight counts in the result, `times` / `of`.
struct Shares {
  std::array<std::uint64_t, kTilePixels> times{};
  std::array<std::uint64_t, kTilePixels> of{};
};

template <class Kernel, int N>
void add_light(const BlendJob& job, const TileRecords& of, const Shares& shares,
               std::array<std::array<std::int16_t, kTilePixels>, N>& light) {
  each_trusted<Kernel, N>(
      job, of, true, [&](std::size_t r, const auto& samples, const Weights& weights, const auto& trusted) {
        for (std::size_t p = 0; p < kTilePixels; ++p) {
          const std::uint64_t weight = weights[p] * std::uint64_t{trusted[p]} * shares.times[p];
          if (weight == 0) continue;
          const std::uint64_t share = ((weight << kWeightBits) + shares.of[p] / 2) / shares.of[p];
          const int i = static_cast<int>(p % kTile);
          const int j = static_cast<int>(p / kTile);
          for (std::size_t c = 0; c < N; ++c) {
            const std::int16_t negative_light = negative_light_of(job, of.grid, r, c, samples[c][p], i, j);
            light[c][p] = wrap(light[c][p] + mulr(negative_light, wrap(-static_cast<int>(share))));
          }
        }
      });
}

/// The general case: a head of the tile is missing, or weights depend on confidence. What the tile's own records then
/// lack to a weight of one is taken from those of its cover, if there is one.
/// False, and nothing done, if no pixel lacks any weight: the tile can then be blended as usual, with the same result.
template <class Kernel, int N, class Number>
[[gnu::noinline]] bool blend_carefully(const BlendJob& job, std::size_t t, Number* out) {
  const TileRecords own(*job.grid, t);
  const WeightSums sums = sums_of<Kernel, N>(job, own);
  const std::uint32_t most = job.careful ? 255 : 1;
  std::array<std::uint32_t, kTilePixels> lacking{};
  bool any = any_missing(job, own);
  for (std::size_t p = 0; p < kTilePixels; ++p) {
    lacking[p] = sums.all[p] * most - sums.trusted[p];
    any = any || lacking[p] != 0;
  }
  if (!any) return false;
  Shares of_own;
  Shares of_cover;
  of_own.times.fill(1);
  for (std::size_t p = 0; p < kTilePixels; ++p) of_own.of[p] = sums.trusted[p];
  const bool covered = job.cover != nullptr && job.cover->tiles[t + 1].record > job.cover->tiles[t].record;
  if (covered) {
    const WeightSums cover = sums_of<Kernel, N>(job, TileRecords(*job.cover, t));
    for (std::size_t p = 0; p < kTilePixels; ++p) {
      if (cover.trusted[p] == 0 || sums.all[p] == 0) continue;
      of_own.of[p] = std::uint64_t{sums.all[p]} * most;
      of_cover.times[p] = lacking[p];
      of_cover.of[p] = of_own.of[p] * cover.trusted[p];
    }
  }
  std::array<std::array<std::int16_t, kTilePixels>, N> light{};
  add_light<Kernel, N>(job, own, of_own, light);
  if (covered) add_light<Kernel, N>(job, TileRecords(*job.cover, t), of_cover, light);
  for (std::size_t c = 0; c < N; ++c) finish_tile(job, c, light[c], out + c * kStrip);
  return true;
}

/// For kernels that interpolate record by record: the light of the pair that begins with record r. Not inlined, so that
/// the code for single records is compiled as if there were no pairs.
template <class Kernel, int N, class Light>
[[gnu::noinline]] void light_of_pair(const BlendJob& job, std::size_t r, Light& negative_light) {
  prefetch<N>(job, r + 1);
  Kernel::template negative_light_of<N, 0, 1>(job, r, negative_light);
  Kernel::template negative_light_of<N, 1, 2>(job, r + 1, negative_light);
}

/// The light of record r, or of the pair that begins with it. Returns how many records these are.
template <class Kernel, int N, class Light>
[[gnu::always_inline]] inline std::size_t next_light(const BlendJob& job, std::size_t r, Light& negative_light) {
  const PatchRecord& record = job.grid->records[r];
  prefetch<N>(job, r);
  if (record.paired()) {
    Light of_pair;  // so that negative_light can stay in registers
    light_of_pair<Kernel, N>(job, r, of_pair);
    negative_light = of_pair;
  } else {
    Kernel::template negative_light_of<N, 0, 2>(job, r, negative_light);
  }
  if (job.low_band != nullptr) Kernel::template correct<N>(job, record.head(), negative_light);
  return record.paired() ? 2 : 1;
}

template <class Kernel, int N, class Number>
void blend_tile(const BlendJob& job, std::size_t t, Number* out) {
  const TileRecords own(*job.grid, t);
  const bool doubtful = job.careful && (own.shared() || (job.cover != nullptr && TileRecords(*job.cover, t).shared()));
  if ((doubtful || any_missing(job, own)) && blend_carefully<Kernel, N, Number>(job, t, out)) return;
  Kernel::template tile<N, Number>(job, own.tile, own.count, out);
}

/// Writes the part of a strip that is inside the grid and within the rows of the call.
template <class Kernel, int N>
void write_strip(const BlendJob& job, int column, int row, const std::uint8_t* strip, std::uint8_t* ends) {
  const int x = column * kTile;
  const int y = row * kTile;
  const int columns = std::min(8 * kTile, job.grid->width - x);
  const int begin = std::max(y, job.row_begin);
  const int end = std::min({y + kTile, job.row_end, job.grid->height});
  const RowEnds of_rows{ends, x == 0, x + 16 * kTile > job.grid->width};
  if (columns == 8 * kTile && end - begin == kTile && Kernel::template emit<N>(job, x, y, strip, of_rows)) return;
  for (std::size_t c = 0; c < N; ++c) {
    const MutablePlaneView& plane = job.out[c];
    for (int j = begin; j < end; ++j) {
      std::uint8_t* to = plane.data + j * plane.row_stride + std::ptrdiff_t{x} * plane.pixel_stride;
      const std::uint8_t* from = strip + c * kStrip + static_cast<std::size_t>((j - y) * kTile);
      int i = 0;
      if (plane.pixel_stride == 1) {
        for (; i + kTile <= columns; i += kTile, to += kTile) std::copy_n(from + i * kTile, kTile, to);
      }
      for (; i < columns; ++i, to += plane.pixel_stride) *to = from[i / kTile * kTilePixels + i % kTile];
    }
  }
}

/// write_strip for 16-bit raymaps: converts light to numbers.
template <class Kernel, int N>
void write_strip(const BlendJob& job, int column, int row, const std::int16_t* strip, std::uint8_t*) {
  const int x = column * kTile;
  const int y = row * kTile;
  const int columns = std::min(8 * kTile, job.grid->width - x);
  alignas(64) std::array<std::uint16_t, N * 8 * kTile> numbers;
  for (int j = std::max(y, job.row_begin); j < std::min({y + kTile, job.row_end, job.grid->height}); ++j) {
    const std::int16_t* from = strip + static_cast<std::size_t>(j - y) * kTile;
    for (std::size_t k = 0; k < 8; ++k) {
      for (std::size_t i = 0; i < kTile; ++i) {
        for (std::size_t c = 0; c < N; ++c) {
          numbers[(k * kTile + i) * N + c] = linear_of(job, from[c * kStrip + k * kTilePixels + i]);
        }
      }
    }
    std::uint8_t* to = job.out[0].data + j * job.out[0].row_stride + std::ptrdiff_t{x} * job.out[0].pixel_stride;
    Kernel::put(to, reinterpret_cast<const std::uint8_t*>(numbers.data()), static_cast<std::size_t>(columns) * N * 2);
  }
}

/// Blends the call's part of a grid. `buffer`: one strip of each component, or GridTable::kBufferSlots if the grid has
/// batches.
template <class Kernel, int N, class Number>
[[gnu::noinline]] void blend_strips(const BlendJob& job, Number* buffer) {
  constexpr std::size_t kEnds = std::size_t{N} * kTile * RowEnds::kBytes;  // bytes of the ends of a row of tiles
  alignas(64) std::array<std::uint8_t, 8 * kEnds> ends;
  const GridTable& grid = *job.grid;
  const bool scattered = !grid.places.empty();
  const bool batched = !grid.batches.empty();
  const int block_rows = grid.block_rows();
  const int blocks_across = grid.tiles_across() / GridTable::kBlockTiles;
  const int first = job.row_begin / kTile;
  const int last = (std::min(job.row_end, grid.height) + kTile - 1) / kTile;
  const auto strips_before = [&](int block_row) { return block_row * blocks_across * block_rows; };
  int begin = strips_before(first / block_rows);
  int end = strips_before((last + block_rows - 1) / block_rows);
  std::size_t batch = 0;
  if (batched) {
    batch = batches_before(grid, job.row_begin);
    begin = static_cast<int>(grid.batches[batch].strip);
    end = static_cast<int>(grid.batches[batches_before(grid, job.row_end)].strip);
  }
  int begun = -1;  // the block that the low band is at
  for (int s = begin; s < end; ++s) {
    const int block = s / block_rows;
    const int row_in_block = s % block_rows;
    const int row = block / blocks_across * block_rows + row_in_block;
    if (!batched && (row < first || row >= last)) continue;
    if (job.low_band != nullptr && block != begun) job.low_band->begin_block(static_cast<std::size_t>(begun = block));
    const std::size_t in_batch = batched ? static_cast<std::size_t>(s) - grid.batches[batch].strip : 0;
    Number* const strip = buffer + GridTable::slot(in_batch, 0, 0, N);
    const std::size_t t = static_cast<std::size_t>(s) * GridTable::kBlockTiles;
    for (std::size_t k = 0; k < GridTable::kBlockTiles; ++k) {
      if (job.low_band != nullptr) job.low_band->begin_tile(static_cast<int>(k), row_in_block);
      blend_tile<Kernel, N, Number>(job, t + k, strip + k * kTilePixels);
    }
    if (batched) {
      if (grid.batches[batch + 1].strip == static_cast<std::uint32_t>(s + 1)) write_batch<N>(job, batch++, buffer);
    } else if (scattered) {
      for (std::size_t k = 0; k < GridTable::kBlockTiles; ++k)
        scatter_tile<N>(job, t + k, row, strip + k * kTilePixels);
    } else {
      write_strip<Kernel, N>(job, block % blocks_across * GridTable::kBlockTiles, row, strip,
                             ends.data() + static_cast<std::size_t>(row_in_block) * kEnds);
    }
  }
}

template <class Kernel, int N, class Number>
void blend_grid(const BlendJob& job) {
  if (job.grid->batches.empty()) {
    alignas(64) std::array<Number, N * kStrip> strip;
    blend_strips<Kernel, N, Number>(job, strip.data());
  } else {
    alignas(64) std::array<Number, GridTable::kBufferSlots> buffer;
    blend_strips<Kernel, N, Number>(job, buffer.data());
  }
}

template <class Kernel>
void blend_by(const BlendJob& job) {
  if (is_linear16(job.table->format)) {
    if (job.components == 1) return blend_grid<Kernel, 1, std::int16_t>(job);
    return blend_grid<Kernel, 3, std::int16_t>(job);
  }
  switch (job.components) {
    case 1: blend_grid<Kernel, 1, std::uint8_t>(job); break;
    case 2: blend_grid<Kernel, 2, std::uint8_t>(job); break;
    case 3: blend_grid<Kernel, 3, std::uint8_t>(job); break;
    default: break;
  }
}

}  // namespace
}  // namespace nodal::blend
