#include "stitch/blend/blend.h"

#include <algorithm>
#include <array>
#include <optional>

#include "stitch/blend/blend_job.h"
#include "stitch/blend/low_band.h"
#include "stitch/blend/tile_math.h"

namespace nodal::blend {
namespace {

struct Kernels {
  std::array<Kernel, 3> list{Kernel::kScalar};
  std::size_t count = 1;
  Kernels() {
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2")) list[count++] = Kernel::kAvx2;
    if (__builtin_cpu_supports("avx512vbmi") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512vl")) {
      list[count++] = Kernel::kAvx512;
    }
#elif defined(__aarch64__)
    list[count++] = Kernel::kNeon;
#endif
  }
};

/// By pixel, the sum of the weights of a tile's records.
struct Presence {
  Weights all{};
  Weights present{};  ///< part of `all` from heads that are not missing
};

Presence presence_of(const GridTable& grid, std::size_t t, Pictures pictures) {
  Presence of;
  Weights weights;
  const std::size_t records = grid.tiles[t + 1].record - grid.tiles[t].record;
  WeightReader reader(grid, grid.tiles[t], records);
  for (std::size_t r = grid.tiles[t].record; r < grid.tiles[t].record + records; ++r) {
    reader.next(weights);
    const bool missing = pictures[grid.records[r].head()].planes[0].data == nullptr;
    for (std::size_t p = 0; p < kTilePixels; ++p) {
      of.all[p] = static_cast<std::uint16_t>(of.all[p] + weights[p]);
      if (!missing) of.present[p] = static_cast<std::uint16_t>(of.present[p] + weights[p]);
    }
  }
  return of;
}

/// Writes the validity of one tile's pixels, for the rows in [row_begin, row_end).
void validity_of_tile(const BlendTable& table, Pictures pictures, const MutablePlaneView& validity, int column, int row,
                      int row_begin, int row_end) {
  const GridTable& grid = table.grids[0];
  const std::size_t t = grid.tile_index(column, row);
  const Presence own = presence_of(grid, t, pictures);
  Weights cover{};
  if (!table.cover.empty()) cover = presence_of(table.cover[0], t, pictures).present;
  for (int y = std::max(row_begin, row * kTile); y < std::min(row_end, (row + 1) * kTile); ++y) {
    for (int x = column * kTile; x < std::min(grid.width, (column + 1) * kTile); ++x) {
      const auto i = static_cast<std::size_t>(x % kTile);
      const std::size_t p = static_cast<std::size_t>(y % kTile) * kTile + i;
      constexpr std::uint32_t kOne = 1U << kWeightBits;
      const auto lacking = static_cast<std::uint32_t>(own.all[p] - own.present[p]);
      const std::uint32_t weight = own.present[p] + (lacking * cover[p] >> kWeightBits);
      const std::uint32_t share = weight * 255 >> kWeightBits;
      const bool part = weight > 0 && weight < kOne;
      std::ptrdiff_t to_x = x;
      std::ptrdiff_t to_y = y;
      if (!grid.places.empty()) {
        const std::uint32_t place = grid.places[t * kTilePixels + static_cast<std::size_t>(y % kTile * kTile) + i];
        to_x = place & 0xffff;
        to_y = place >> 16;
      }
      validity.data[to_y * validity.row_stride + to_x * validity.pixel_stride] =
          static_cast<std::uint8_t>(part ? std::clamp(share, 1U, 254U) : share);
    }
  }
}

/// Fades the chroma of rows [row_begin, row_end) of the raymap.
void fade_chroma(const ChromaFade& fade, const MutableImageView& raymap, int row_begin, int row_end) {
  const MutablePlaneView& luma = raymap.planes[0];
  for (int y = row_begin; y < row_end; y += 2) {
    const std::uint8_t* upper = luma.data + y * luma.row_stride;
    const std::uint8_t* lower = y + 1 < raymap.height ? upper + luma.row_stride : upper;
    std::uint8_t* u = raymap.planes[1].data + y / 2 * raymap.planes[1].row_stride;
    std::uint8_t* v = raymap.planes[2].data + y / 2 * raymap.planes[2].row_stride;
    const int step = raymap.planes[1].pixel_stride;
    for (int x = 0; x < (raymap.width + 1) / 2; ++x, u += step, v += step) {
      const int right = std::min(2 * x + 1, raymap.width - 1);
      const int level = (upper[2 * x] + upper[right] + lower[2 * x] + lower[right] + 2) >> 2;
      const int left = fade.of_luma[static_cast<std::size_t>(level)];
      *u = static_cast<std::uint8_t>(128 + (((*u - 128) * left + 128) >> 8));
      *v = static_cast<std::uint8_t>(128 + (((*v - 128) * left + 128) >> 8));
    }
  }
}

}  // namespace

std::string_view kernel_name(Kernel kernel) {
  switch (kernel) {
    case Kernel::kScalar: return "scalar";
    case Kernel::kAvx2: return "avx2";
    case Kernel::kAvx512: return "avx512";
    case Kernel::kNeon: return "neon";
  }
  return "unknown";
}

std::span<const Kernel> kernels() {
  static const Kernels here;
  return std::span(here.list).first(here.count);
}

void blend_rows(const BlendTable& table, Pictures pictures, const SetTone& tone, const MutableImageView& raymap,
                int row_begin, int row_end) {
  blend_rows_by(kernels().back(), table, pictures, tone, raymap, row_begin, row_end);
}

void blend_rows_by(Kernel kernel, const BlendTable& table, Pictures pictures, const SetTone& tone,
                   const MutableImageView& raymap, int row_begin, int row_end) {
  for (std::size_t g = 0; g < table.grids.size(); ++g) {
    BlendJob job;
    make_job(table, g, pictures, tone, raymap, row_begin, row_end, job);
    std::optional<LowBand> low_band;
    if (!job.grid->low.cells.empty()) job.low_band = &low_band.emplace(job);
    switch (kernel) {
#if defined(__x86_64__)
      case Kernel::kAvx2: blend_avx2(job); break;
      case Kernel::kAvx512: blend_avx512(job); break;
#elif defined(__aarch64__)
      case Kernel::kNeon: blend_neon(job); break;
#endif
      default: blend_scalar(job); break;
    }
  }
  if (tone.fade && has_chroma(raymap.format) && table.grids[0].places.empty()) {
    fade_chroma(*tone.fade, raymap, row_begin, row_end);
  }
}

void validity_rows(const BlendTable& table, Pictures pictures, const MutablePlaneView& validity, int row_begin,
                   int row_end) {
  const GridTable& grid = table.grids[0];
  for (int row = row_begin / kTile; row * kTile < std::min(row_end, grid.height); ++row) {
    for (int column = 0; column * kTile < grid.width; ++column) {
      validity_of_tile(table, pictures, validity, column, row, row_begin, row_end);
    }
  }
}

}  // namespace nodal::blend
