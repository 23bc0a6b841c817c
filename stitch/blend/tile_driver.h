// How a call of blend_rows goes through its tiles, for any kernel. Internal to stitch/blend; in an unnamed namespace for
// the reason that tile_math.h gives. A kernel is a type with
//
//   template <int N> static void tile(const BlendJob&, const Tile&, std::size_t records, std::uint8_t* out);
//     the levels of N components of a tile none of whose heads is missing, row by row, each kStrip after the other;
//   template <int N> static void samples(const BlendJob&, const PatchRecord&, std::array<Dark, N>&);
//     the samples of a record's pixels with weight, before curve and gain;
//   template <int N> static bool emit(const BlendJob&, int x, int y, const std::uint8_t* strip);
//     writes a whole strip to the raymap at (x, y), or leaves that to others.
#pragma once

#include "stitch/blend/tile_math.h"

namespace nodal::blend {
namespace {

/// Eight tiles side by side, 64 bytes each.
constexpr std::size_t kStrip = 8 * kTilePixels;

/// Whether the raymap is R G B R G B ..
inline bool interleaved(const BlendJob& job) {
  const auto& out = job.out;
  return out[0].pixel_stride == 3 && out[1].data == out[0].data + 1 && out[2].data == out[0].data + 2;
}

/// The general way: some head of the tile is missing, or heads are trusted by what they saw. Goes over the records
/// twice, first for the sum of the weights.
template <class Kernel, int N>
void blend_carefully(const BlendJob& job, const Tile& tile, std::size_t records, std::uint8_t* out) {
  std::array<std::uint32_t, kTilePixels> sum{};
  std::array<std::array<std::int16_t, kTilePixels>, N> light{};
  std::array<Dark, N> samples;
  Weights weights;
  std::array<std::uint8_t, kTilePixels> trusted;
  trusted.fill(1);
  for (const bool adding_up : {true, false}) {
    WeightReader reader(*job.grid, tile, records);
    for (std::size_t r = tile.record; r < tile.record + records; ++r) {
      const PatchRecord& record = job.grid->records[r];
      reader.next(weights);
      if ((job.missing >> record.head() & 1) != 0) continue;
      if (job.careful || !adding_up) Kernel::template samples<N>(job, record, samples);
      if (job.careful) trust(job, record, samples, trusted);
      for (std::size_t p = 0; p < kTilePixels; ++p) {
        const std::uint32_t weight = weights[p] * std::uint32_t{trusted[p]};
        if (adding_up) {
          sum[p] += weight;
          continue;
        }
        if (weight == 0) continue;
        const std::uint64_t share = ((std::uint64_t{weight} << kWeightBits) + sum[p] / 2) / sum[p];
        const int i = static_cast<int>(p % kTile);
        const int j = static_cast<int>((p / kTile & 3) * 2 + p / (kTilePixels / 2));
        for (std::size_t c = 0; c < N; ++c) {
          const std::int16_t dark = dark_of(job, r, c, samples[c][p], i, j);
          light[c][p] = wrap(light[c][p] + mulr(dark, wrap(-static_cast<int>(share))));
        }
      }
    }
  }
  for (std::size_t c = 0; c < N; ++c) {
    for (std::size_t j = 0; j < kTile; ++j) {
      for (std::size_t i = 0; i < kTile; ++i) out[c * kStrip + j * kTile + i] = level_of(job, c, light[c][pixel_place(i, j)]);
    }
  }
}

template <class Kernel, int N>
void blend_tile(const BlendJob& job, std::size_t t, std::uint8_t* out) {
  const Tile& tile = job.grid->tiles[t];
  const std::size_t records = job.grid->tiles[t + 1].record - tile.record;
  bool carefully = job.careful && records > 1;
  if (job.missing != 0) {
    for (std::size_t r = tile.record; r < tile.record + records; ++r) {
      carefully = carefully || (job.missing >> job.grid->records[r].head() & 1) != 0;
    }
  }
  if (carefully) {
    blend_carefully<Kernel, N>(job, tile, records, out);
  } else {
    Kernel::template tile<N>(job, tile, records, out);
  }
}

/// Writes what of a strip lies inside the grid and the rows of the call.
template <class Kernel, int N>
void write_strip(const BlendJob& job, int column, int row, const std::uint8_t* strip) {
  const int x = column * kTile;
  const int y = row * kTile;
  const int columns = std::min(8 * kTile, job.grid->width - x);
  const int begin = std::max(y, job.row_begin);
  const int end = std::min({y + kTile, job.row_end, job.grid->height});
  if (columns == 8 * kTile && end - begin == kTile && Kernel::template emit<N>(job, x, y, strip)) return;
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

/// Where the pixels of a tile that lie anywhere (GridTable::places) are in a plane; of those beyond the grid, not.
inline std::array<std::ptrdiff_t, kTilePixels> places_in(const MutablePlaneView& plane, const std::uint32_t* places) {
  std::array<std::ptrdiff_t, kTilePixels> to;
  for (std::size_t p = 0; p < kTilePixels; ++p) {
    to[p] = std::ptrdiff_t{places[p] >> 16} * plane.row_stride + std::ptrdiff_t{places[p] & 0xffff} * plane.pixel_stride;
  }
  return to;
}

/// Writes a strip of pixels that lie anywhere; t: its first tile.
template <int N>
void scatter_strip(const BlendJob& job, std::size_t t, int row, const std::uint8_t* strip) {
  const auto begin = static_cast<std::size_t>(std::max(0, job.row_begin - row * kTile) * kTile);
  const auto end = static_cast<std::size_t>(std::min(kTile, job.row_end - row * kTile) * kTile);
  const std::uint32_t* places = job.grid->places.data() + t * kTilePixels;
  for (std::size_t k = 0; k < 8; ++k, places += kTilePixels, strip += kTilePixels) {
    const bool whole = places[kTilePixels - 1] != GridTable::kNowhere;
    for (std::size_t c = 0; c < N; ++c) {
      const std::array<std::ptrdiff_t, kTilePixels> to = places_in(job.out[c], places);
      std::uint8_t* data = job.out[c].data;
      const std::uint8_t* from = strip + c * kStrip;
      if (whole) {
        for (std::size_t p = begin; p < end; ++p) data[to[p]] = from[p];
      } else {
        for (std::size_t p = begin; p < end; ++p) {
          if (places[p] != GridTable::kNowhere) data[to[p]] = from[p];
        }
      }
    }
  }
}

template <class Kernel, int N>
void blend_grid(const BlendJob& job) {
  alignas(64) std::array<std::uint8_t, N * kStrip> strip;
  const GridTable& grid = *job.grid;
  const int block_rows = grid.block_rows();
  const int first = job.row_begin / kTile;
  const int last = (std::min(job.row_end, grid.height) + kTile - 1) / kTile;
  for (int block = first / block_rows * block_rows; block < last; block += block_rows) {
    for (int column = 0; column * kTile < grid.width; column += GridTable::kBlockTiles) {
      for (int row = std::max(first, block); row < std::min(last, block + block_rows); ++row) {
        const std::size_t t = grid.tile_index(column, row);
        for (std::size_t k = 0; k < GridTable::kBlockTiles; ++k) {
          blend_tile<Kernel, N>(job, t + k, strip.data() + k * kTilePixels);
        }
        if (grid.places.empty()) {
          write_strip<Kernel, N>(job, column, row, strip.data());
        } else {
          scatter_strip<N>(job, t, row, strip.data());
        }
      }
    }
  }
}

template <class Kernel>
void blend_by(const BlendJob& job) {
  switch (job.components) {
    case 1: blend_grid<Kernel, 1>(job); break;
    case 2: blend_grid<Kernel, 2>(job); break;
    case 3: blend_grid<Kernel, 3>(job); break;
    default: break;
  }
}

}  // namespace
}  // namespace nodal::blend
