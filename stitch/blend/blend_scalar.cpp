// The specification of the blend, one sample after the other. See blend.h for the arithmetic in words.
#include <algorithm>

#include "stitch/blend/blend.h"

namespace nodal::blend {
namespace {

constexpr std::int32_t kFractionOne = 1 << kFractionBits;
constexpr std::int32_t kWeightOne = 1 << kWeightBits;
constexpr std::int32_t kGainHalf = 1 << (kGainBits - 1);
/// Of a tap's value times its gain, below one level.
constexpr int kLightBits = 2 * kFractionBits + kGainBits;
static_assert(8 + 2 * kFractionBits + 15 + kWeightBits < 63, "a sum of lights must fit a signed 64-bit number");

/// The components that share a grid, with what every tap of them needs, gathered once a call.
struct Group {
  int count = 0;
  std::array<int, kMaxPlanes> component{};
  std::array<std::int32_t, kMaxPlanes> black{};
  std::array<std::array<std::int32_t, kMaxPlanes>, kMaxHeads> head_gain{};
};

Group group_of(const BlendTable& table, int grid) {
  Group group;
  const int components = component_count(table.format);
  for (int c = 0; c < components; ++c) {
    const ComponentRule& rule = table.components[static_cast<std::size_t>(c)];
    if (rule.grid != grid) continue;
    const auto slot = static_cast<std::size_t>(group.count++);
    group.component[slot] = c;
    group.black[slot] = rule.black;
    for (std::size_t h = 0; h < table.sources.size(); ++h) {
      group.head_gain[h][slot] = table.sources[h].gain[rule.gain_row];
    }
  }
  return group;
}

/// 2x2 source samples mixed by the tap's fractions; 1 level is 1 << (2 * kFractionBits).
inline std::int64_t bilinear(const PlaneView& plane, const Tap& tap) {
  const std::uint8_t* upper = plane.data + tap.y * plane.row_stride + std::ptrdiff_t{tap.x} * plane.pixel_stride;
  const std::uint8_t* lower = upper + plane.row_stride;
  const std::int32_t fx = tap.fraction_x;
  const std::int32_t top = upper[0] * (kFractionOne - fx) + upper[plane.pixel_stride] * fx;
  const std::int32_t bottom = lower[0] * (kFractionOne - fx) + lower[plane.pixel_stride] * fx;
  return std::int64_t{top} * (kFractionOne - tap.fraction_y) + std::int64_t{bottom} * tap.fraction_y;
}

inline std::int32_t gain_of(const Tap& tap, std::int32_t head_gain) {
  return std::min<std::int32_t>(kMaxGain, (tap.gain * head_gain + kGainHalf) >> kGainBits);
}

/// black + light / weight in one rounding. `weight` is what the taps that were there add up to.
inline std::uint8_t to_level(std::int64_t light, std::int32_t weight, std::int32_t black) {
  const std::int64_t one = std::int64_t{weight} << kLightBits;
  const std::int64_t level = light + black * one + one / 2;
  if (level < 0) return 0;
  // The usual case divides by a power of two; the same result, without the division.
  const std::int64_t whole = weight == kWeightOne ? level >> (kLightBits + kWeightBits) : level / one;
  return static_cast<std::uint8_t>(std::min<std::int64_t>(whole, 255));
}

template <int kCount>
void blend_grid(const GridTable& grid, const Group& group, std::span<const ImageView> heads,
                const MutableImageView& raymap, int row_begin, int row_end) {
  for (int y = row_begin; y < row_end; ++y) {
    std::array<std::uint8_t*, kCount> out;
    for (std::size_t k = 0; k < kCount; ++k) {
      const MutablePlaneView& plane = raymap.planes[static_cast<std::size_t>(group.component[k])];
      out[k] = plane.data + y * plane.row_stride;
    }
    const std::uint32_t* first = grid.first.data() + std::ptrdiff_t{y} * grid.width;
    const Tap* tap = grid.taps.data() + first[0];
    for (int x = 0; x < grid.width; ++x) {
      std::array<std::int64_t, kCount> light{};
      std::int32_t weight = 0;
      for (const Tap* end = grid.taps.data() + first[x + 1]; tap != end; ++tap) {
        const ImageView& head = heads[tap->head];
        if (head.planes[0].data == nullptr) continue;
        weight += tap->weight;
        for (std::size_t k = 0; k < kCount; ++k) {
          const std::int64_t value = bilinear(head.planes[static_cast<std::size_t>(group.component[k])], *tap);
          const std::int64_t above_black = value - (std::int64_t{group.black[k]} << (2 * kFractionBits));
          light[k] += above_black * gain_of(*tap, group.head_gain[tap->head][k]) * tap->weight;
        }
      }
      for (std::size_t k = 0; k < kCount; ++k) {
        *out[k] = weight == 0 ? static_cast<std::uint8_t>(group.black[k])
                              : to_level(light[k], weight, group.black[k]);
        out[k] += raymap.planes[static_cast<std::size_t>(group.component[k])].pixel_stride;
      }
    }
  }
}

/// The grid's rows that raymap rows up to `row` have begun.
int grid_row(const GridTable& grid, int row) { return (row + grid.row_step - 1) / grid.row_step; }

}  // namespace

void blend_rows(const BlendTable& table, std::span<const ImageView> heads, const MutableImageView& raymap,
                int row_begin, int row_end) {
  for (std::size_t g = 0; g < table.grids.size(); ++g) {
    const GridTable& grid = table.grids[g];
    const Group group = group_of(table, static_cast<int>(g));
    const int begin = grid_row(grid, row_begin);
    const int end = grid_row(grid, row_end);
    switch (group.count) {
      case 1: blend_grid<1>(grid, group, heads, raymap, begin, end); break;
      case 2: blend_grid<2>(grid, group, heads, raymap, begin, end); break;
      case 3: blend_grid<3>(grid, group, heads, raymap, begin, end); break;
      default: break;
    }
  }
}

void validity_rows(const BlendTable& table, std::span<const ImageView> heads, const MutablePlaneView& validity,
                   int row_begin, int row_end) {
  const GridTable& grid = table.grids[0];
  for (int y = row_begin; y < row_end; ++y) {
    const std::uint32_t* first = grid.first.data() + std::ptrdiff_t{y} * grid.width;
    std::uint8_t* out = validity.data + y * validity.row_stride;
    for (int x = 0; x < grid.width; ++x, out += validity.pixel_stride) {
      std::int32_t weight = 0;
      for (std::uint32_t t = first[x]; t < first[x + 1]; ++t) {
        const Tap& tap = grid.taps[t];
        if (heads[tap.head].planes[0].data != nullptr) weight += tap.weight;
      }
      const std::int32_t share = weight * 255 / kWeightOne;
      const bool part = weight > 0 && weight < kWeightOne;
      *out = static_cast<std::uint8_t>(part ? std::clamp(share, 1, 254) : share);
    }
  }
}

}  // namespace nodal::blend
