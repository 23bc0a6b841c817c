// How pixels are written that are not where their tiles are (GridTable::places). Internal to stitch/blend; in an
// unnamed namespace for the reason given in tile_math.h.
#pragma once

#include <cstring>

#include "stitch/blend/tile_math.h"

namespace nodal::blend {
namespace {

/// Pixels of a strip: eight tiles side by side.
constexpr std::size_t kStrip = GridTable::kBlockTiles * kTilePixels;

/// The 16-bit number that is written for `light`.
inline std::uint16_t linear_of(const BlendJob& job, std::int16_t light) {
  return job.table->linear[static_cast<std::size_t>(std::max<std::int16_t>(light, 0))];
}

/// Writes a tile's pixel p, as stored in a component's strip.
inline void put_pixel(const BlendJob&, const std::uint8_t* strip, std::size_t p, std::uint8_t* to) { *to = strip[p]; }
inline void put_pixel(const BlendJob& job, const std::int16_t* strip, std::size_t p, std::uint8_t* to) {
  const std::uint16_t number = linear_of(job, strip[p]);
  std::memcpy(to, &number, sizeof number);
}

/// The byte offsets of a tile's pixels in a plane, by GridTable::places; meaningless for pixels outside the grid.
inline std::array<std::ptrdiff_t, kTilePixels> places_in(const MutablePlaneView& plane, const std::uint32_t* places) {
  std::array<std::ptrdiff_t, kTilePixels> to;
  for (std::size_t p = 0; p < kTilePixels; ++p) {
    to[p] =
        std::ptrdiff_t{places[p] >> 16} * plane.row_stride + std::ptrdiff_t{places[p] & 0xffff} * plane.pixel_stride;
  }
  return to;
}

/// Writes tile t, whose pixels have positions of their own (GridTable::places); component c is at tile + c * kStrip.
template <int N, class Number>
void scatter_tile(const BlendJob& job, std::size_t t, int row, const Number* tile) {
  const auto begin = static_cast<std::size_t>(std::max(0, job.row_begin - row * kTile) * kTile);
  const auto end = static_cast<std::size_t>(std::min(kTile, job.row_end - row * kTile) * kTile);
  const std::uint32_t* places = job.grid->places.data() + t * kTilePixels;
  const bool whole = places[kTilePixels - 1] != GridTable::kNowhere;
  for (std::size_t c = 0; c < N; ++c) {
    const std::array<std::ptrdiff_t, kTilePixels> to = places_in(job.out[c], places);
    std::uint8_t* data = job.out[c].data;
    const Number* from = tile + c * kStrip;
    if (whole) {
      for (std::size_t p = begin; p < end; ++p) put_pixel(job, from, p, data + to[p]);
    } else {
      for (std::size_t p = begin; p < end; ++p) {
        if (places[p] != GridTable::kNowhere) put_pixel(job, from, p, data + to[p]);
      }
    }
  }
}

/// The address of a component's pixel.
inline std::uint8_t* address(const MutablePlaneView& plane, std::uint32_t place) {
  return plane.data + std::ptrdiff_t{place >> 16} * plane.row_stride +
         std::ptrdiff_t{place & 0xffff} * plane.pixel_stride;
}

/// Writes run r of a batch.
template <int N, class Number>
void write_run(const BlendJob& job, std::size_t r, const Number* buffer) {
  const GridTable::Run run = job.grid->runs[r];
  const std::uint16_t* slots = job.grid->slots.data() + run.slot;
  const std::size_t count = job.grid->runs[r + 1].slot - run.slot;
  for (std::size_t c = 0; c < N; ++c) {
    const Number* from = buffer + c * kStrip;
    std::uint8_t* to = address(job.out[c], run.place);
    const int step = job.out[c].pixel_stride;
    std::size_t i = 0;
    if constexpr (sizeof(Number) == 1) {
      if (step == 1) {
        for (; i + 8 <= count; i += 8) {  // one store, and the compiler need not expect that it changes `slots`
          std::array<std::uint8_t, 8> levels;
          for (std::size_t k = 0; k < 8; ++k) levels[k] = from[slots[i + k]];
          std::memcpy(to + i, levels.data(), 8);
        }
      }
    }
    to += static_cast<std::ptrdiff_t>(i) * step;
    for (; i < count; ++i, to += step) put_pixel(job, from, slots[i], to);
  }
}

/// Fetches the cache lines in which a run begins and ends. Always inlined: GCC takes a function that only prefetches
/// for one without effect, and removes calls of it.
template <int N>
[[gnu::always_inline]] inline void prefetch_run(const BlendJob& job, std::size_t r) {
  const GridTable::Run run = job.grid->runs[r];
  const std::uint32_t count = job.grid->runs[r + 1].slot - run.slot;
  for (std::size_t c = 0; c < N; ++c) {
    __builtin_prefetch(address(job.out[c], run.place), 1);
    __builtin_prefetch(address(job.out[c], run.place + count - 1), 1);
  }
}

/// Writes a batch that has been blended into the buffer.
template <int N, class Number>
void write_batch(const BlendJob& job, std::size_t b, const Number* buffer) {
  constexpr std::size_t kAhead = 16;
  const std::size_t end = job.grid->batches[b + 1].run;
  for (std::size_t r = job.grid->batches[b].run; r < end; ++r) {
    if (r + kAhead < end) prefetch_run<N>(job, r + kAhead);
    write_run<N, Number>(job, r, buffer);
  }
}

/// The number of batches that begin above a row of the grid, if tiles are counted row by row.
inline std::size_t batches_before(const GridTable& grid, int row) {
  const auto across = static_cast<std::size_t>(grid.tiles_across() / GridTable::kBlockTiles);
  std::size_t count = 0;
  while (count + 1 < grid.batches.size() &&
         std::min(static_cast<int>(grid.batches[count].strip / across) * kTile, grid.height - 1) < row) {
    ++count;
  }
  return count;
}

}  // namespace
}  // namespace nodal::blend
