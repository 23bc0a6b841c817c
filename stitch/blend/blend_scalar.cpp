// The specification of the blend, one sample after the other. See blend.h for the arithmetic in words.
#include <algorithm>

#include "stitch/blend/blend.h"

namespace nodal::blend {
namespace {

constexpr std::int32_t kFractionOne = 1 << kFractionBits;
constexpr std::int32_t kSharpenOne = 1 << kSharpenBits;
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
  std::array<std::int32_t, kMaxHeads> sharpen{};
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
      group.sharpen[h] = table.sources[h].sharpen;
    }
  }
  return group;
}

/// The 2x2 samples of a tap: (0,0), (1,0), (0,1), (1,1).
using Corners = std::array<std::int32_t, 4>;

inline Corners corners(const PlaneView& plane, const Tap& tap) {
  const std::uint8_t* at = plane.data + tap.y * plane.row_stride + std::ptrdiff_t{tap.x} * plane.pixel_stride;
  const std::uint8_t* lower = at + plane.row_stride;
  return {at[0], at[plane.pixel_stride], lower[0], lower[plane.pixel_stride]};
}

/// The same samples, each sharpened by its four neighbours; beyond the picture's edge the edge is repeated.
inline Corners sharpened_corners(const PlaneView& plane, const Tap& tap, std::int32_t sharpen) {
  const std::ptrdiff_t right = plane.pixel_stride;
  const std::ptrdiff_t down = plane.row_stride;
  const std::uint8_t* a = plane.data + tap.y * down + std::ptrdiff_t{tap.x} * right;
  const std::uint8_t* b = a + right;
  const std::uint8_t* c = a + down;
  const std::uint8_t* d = b + down;
  const std::ptrdiff_t west = tap.x > 0 ? right : 0;
  const std::ptrdiff_t east = tap.x + 2 < plane.width ? right : 0;
  const std::ptrdiff_t north = tap.y > 0 ? down : 0;
  const std::ptrdiff_t south = tap.y + 2 < plane.height ? down : 0;
  const auto level = [sharpen](std::int32_t own, std::int32_t around) {
    const std::int32_t sum = (kSharpenOne + 4 * sharpen) * own - sharpen * around + kSharpenOne / 2;
    return std::clamp(sum >> kSharpenBits, 0, 255);
  };
  return {level(*a, a[-west] + a[-north] + *b + *c), level(*b, b[east] + b[-north] + *a + *d),
          level(*c, c[-west] + c[south] + *a + *d), level(*d, d[east] + d[south] + *b + *c)};
}

/// Mixed by the tap's fractions; 1 level is 1 << (2 * kFractionBits).
inline std::int64_t bilinear(const Corners& at, const Tap& tap) {
  const std::int32_t top = at[0] * (kFractionOne - tap.fraction_x) + at[1] * tap.fraction_x;
  const std::int32_t bottom = at[2] * (kFractionOne - tap.fraction_x) + at[3] * tap.fraction_x;
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
          const PlaneView& plane = head.planes[static_cast<std::size_t>(group.component[k])];
          const std::int32_t sharpen = group.sharpen[tap->head];
          const Corners at = sharpen == 0 ? corners(plane, *tap) : sharpened_corners(plane, *tap, sharpen);
          const std::int64_t value = bilinear(at, *tap);
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
