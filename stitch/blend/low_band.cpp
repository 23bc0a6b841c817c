#include "stitch/blend/low_band.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "stitch/blend/clones.h"
#include "stitch/blend/low_picture.h"
#include "stitch/blend/tile_math.h"

namespace nodal::blend {
namespace {

LowSample low_sample(const std::uint8_t* at) {
  LowSample sample;
  std::memcpy(&sample, at, sizeof sample);
  return sample;
}

/// The four samples around a sight; beyond the low picture's edge, the edge sample again.
struct Four {
  const std::uint8_t* above;
  const std::uint8_t* below;
  std::ptrdiff_t right;

  Four(const PlaneView& plane, const LowSight& at) {
    // The sights of chroma may lie one sample beyond a low picture of luma whose size is odd.
    const int x = std::min(at.x >> 8, plane.width - 1);
    const int y = std::min(at.y >> 8, plane.height - 1);
    constexpr std::ptrdiff_t kStep = sizeof(LowSample);
    above = plane.data + y * plane.row_stride + kStep * x;
    below = above + (y + 1 < plane.height ? plane.row_stride : 0);
    right = x + 1 < plane.width ? kStep : 0;
  }
};

/// In 1/128 of a level.
int low_sample_at(const PlaneView& plane, const LowSight& at) {
  const Four four(plane, at);
  const std::uint32_t f = at.x & 255;
  const std::uint32_t g = at.y & 255;
  const std::uint32_t top = low_sample(four.above).mean * (256 - f) + low_sample(four.above + four.right).mean * f;
  const std::uint32_t bottom = low_sample(four.below).mean * (256 - f) + low_sample(four.below + four.right).mean * f;
  return static_cast<int>((top * (256 - g) + bottom * g + (1U << 15)) >> 16);  // kMaxSample << 16 fits 32 bits
}

using Corners = std::array<std::array<std::int32_t, GridTable::kBlockTiles * GridTable::kBlockTiles>, 4>;

/// Coefficients of 1, i, j, ij: the corrections in the tile (column, row) of every cell, by those at the cells'
/// corners. A cell is 1 << kBits pixels wide; products are scaled by its square, so that each coefficient is rounded
/// once.
template <int kBits>
[[gnu::always_inline]] inline void fit(const Corners& corners, std::size_t cells, int column, int row,
                                       std::array<std::int16_t, 4>* to) {
  const auto rounded = [](int value, int shift) { return (value + (1 << (shift - 1))) >> shift; };
  const int x = 16 * column + 1;  // x and y of pixel centres, in half pixels from the cell's corner
  const int y = 16 * row + 1;
  std::array<std::uint32_t, 2 * GridTable::kBlockTiles * GridTable::kBlockTiles> pairs;
  const auto pair = [](int lower, int upper) {
    return (static_cast<std::uint32_t>(lower) & 0xffff) | static_cast<std::uint32_t>(upper) << 16;
  };
  for (std::size_t k = 0; k < cells; ++k) {
    const int corner = corners[0][k];
    const int across = corners[1][k] - corner;
    const int down = corners[2][k] - corner;
    const int both = corners[3][k] - corners[2][k] - across;
    pairs[2 * k] =
        pair(rounded((corner << (2 * kBits + 2)) + ((across * x + down * y) << (kBits + 1)) + both * x * y, 2 * kBits),
             rounded((across << (kBits + 1)) + both * y, 2 * kBits - 1));
    pairs[2 * k + 1] = pair(rounded((down << (kBits + 1)) + both * x, 2 * kBits - 1), rounded(both, 2 * kBits - 2));
  }
  std::memcpy(to, pairs.data(), cells * sizeof *to);
}
NODAL_CLONES void fit_small_cells(const Corners& corners, std::size_t cells, std::array<std::int16_t, 4>* to) {
  fit<3>(corners, cells, 0, 0, to);
}
NODAL_CLONES void fit_large_cells(const Corners& corners, std::size_t cells, std::array<std::int16_t, 4>* to) {
  for (int part = 0; part < 4; ++part, to += cells) fit<4>(corners, cells, part % 2, part / 2, to);
}

std::int64_t floor_div(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }

}  // namespace

LowBand::LowBand(const BlendJob& job)
    : job_(job),
      grid_(*job.grid),
      cell_bits_(grid_.low.cell_tiles == 2 ? 1 : 0),
      cell_count_(static_cast<std::size_t>(grid_.low_cells_across() * grid_.low_cells_down())) {}

std::int16_t LowBand::negative_light(const LowSight& sight, std::size_t c) const {
  const JobComponent& component = job_.component[c];
  const PlaneView& plane = job_.low[sight.head].planes[static_cast<std::size_t>(component.component)];
  const int sample = low_sample_at(plane, sight);
  const int shown = job_.curves ? curve_at<10>(job_.curve[sight.head][component.tone], sample) : sample;
  const std::int16_t negative = wrap(component.black - shown);
  if (!job_.gains) return negative;
  const std::int16_t gain = job_.gain(sight.head, c);
  return mulr(negative, sight.gain == 0 ? gain : mulr(sight.gain, gain));
}

/// The least confidence in any sample around the sight: in its darkest and its brightest level, of luma or of R G B.
std::uint32_t LowBand::confidence(const LowSight& sight) const {
  if (!job_.careful) return kSure;
  const ImageView& low = job_.low[sight.head];
  std::uint8_t least = 255;
  std::uint8_t most = 0;
  const std::size_t planes = has_chroma(low.format) ? 1 : static_cast<std::size_t>(component_count(low.format));
  for (std::size_t c = 0; c < planes; ++c) {
    const Four four(low.planes[c], sight);
    for (const std::uint8_t* at : {four.above, four.above + four.right, four.below, four.below + four.right}) {
      least = std::min(least, low_sample(at).least);
      most = std::max(most, low_sample(at).most);
    }
  }
  const auto& of_level = job_.tone->confidence->of_level[sight.head];
  return std::min(of_level[least], of_level[most]);
}

void LowBand::set(HeadIndex head, std::size_t c, std::size_t point, std::int16_t correction) {
  at_[head][c][point - first_point_] = correction;
  if (correction != 0) corrected_ |= 1U << head;
}

void LowBand::correct(std::size_t point) {
  const LowGrid& low = grid_.low;
  const std::size_t begin = low.first_sight[point];
  const std::size_t end = low.first_sight[point + 1];
  const auto components = static_cast<std::size_t>(job_.components);
  if (end - begin == 1) {  // there is nothing to compare with
    for (std::size_t c = 0; c < components; ++c) set(low.sights[begin].head, c, point, 0);
    return;
  }
  if (job_.careful || job_.missing != 0) return correct_carefully(point);
  // The same with full confidence in all heads: weights sum to one, and 32 bits suffice.
  std::array<std::array<std::int16_t, kMaxPlanes>, kMaxHeads> light;
  std::array<std::int32_t, kMaxPlanes> sum{};
  for (std::size_t s = begin; s < end; ++s) {
    const LowSight& sight = low.sights[s];
    for (std::size_t c = 0; c < components; ++c) {
      light[s - begin][c] = negative_light(sight, c);
      sum[c] += sight.weight * light[s - begin][c];
    }
  }
  for (std::size_t c = 0; c < components; ++c) {
    const std::int32_t mean = (sum[c] + (1 << (kWeightBits - 1))) >> kWeightBits;
    for (std::size_t s = begin; s < end; ++s) {
      const std::int32_t full = std::clamp(mean - light[s - begin][c], -kMaxCorrection, kMaxCorrection);
      set(low.sights[s].head, c, point, static_cast<std::int16_t>(full));
    }
  }
}

/// A head is missing, or confidence is used.
void LowBand::correct_carefully(std::size_t point) {
  const LowGrid& low = grid_.low;
  const std::size_t begin = low.first_sight[point];
  const std::size_t end = low.first_sight[point + 1];
  std::array<std::array<std::int16_t, kMaxPlanes>, kMaxHeads> light;
  std::array<std::uint32_t, kMaxHeads> sure;
  std::array<std::int64_t, kMaxPlanes> sum{};
  std::int64_t weights = 0;
  const auto components = static_cast<std::size_t>(job_.components);
  const auto missing = [&](std::size_t s) { return (job_.missing >> low.sights[s].head & 1) != 0; };
  for (std::size_t s = begin; s < end; ++s) {
    if (missing(s)) continue;
    const LowSight& sight = low.sights[s];
    sure[s - begin] = confidence(sight);
    const std::int64_t weight = std::int64_t{sight.weight} * sure[s - begin];
    weights += weight;
    for (std::size_t c = 0; c < components; ++c) {
      light[s - begin][c] = negative_light(sight, c);
      sum[c] += weight * light[s - begin][c];
    }
  }
  if (weights == 0) return;
  for (std::size_t c = 0; c < components; ++c) {
    const std::int64_t mean = weights == kSure << kWeightBits
                                  ? (sum[c] / kSure + (1 << (kWeightBits - 1))) >> kWeightBits
                                  : floor_div(2 * sum[c] + weights, 2 * weights);
    for (std::size_t s = begin; s < end; ++s) {
      if (missing(s)) continue;
      const std::int64_t full = std::clamp<std::int64_t>(mean - light[s - begin][c], -kMaxCorrection, kMaxCorrection);
      set(low.sights[s].head, c, point, static_cast<std::int16_t>(full * sure[s - begin] / kSure));
    }
  }
}

void LowBand::begin_block(std::size_t block) {
  const LowGrid& low = grid_.low;
  first_point_ = low.first_point[block];
  const std::size_t last = low.first_point[block + 1];
  cells_ = low.cells.data() + block * cell_count_;
  corrected_ = 0;
  std::uint32_t most = 0;  // sights of a point
  for (std::size_t p = first_point_; p < last; ++p) most = std::max(most, low.first_sight[p + 1] - low.first_sight[p]);
  if (most < 2) return;
  std::uint32_t seen = 0;
  for (std::size_t s = low.first_sight[first_point_]; s < low.first_sight[last]; ++s) {
    seen |= 1U << low.sights[s].head;
  }
  for (std::size_t h = 0; h < kMaxHeads; ++h) {
    if ((seen >> h & 1) == 0) continue;
    for (std::size_t c = 0; c < static_cast<std::size_t>(job_.components); ++c) {
      std::fill_n(at_[h][c].begin(), last - first_point_, kUnseen);
    }
  }
  for (std::size_t point = first_point_; point < last; ++point) correct(point);
  for (std::uint32_t left = corrected_; left != 0; left &= left - 1) {
    const auto head = static_cast<HeadIndex>(std::countr_zero(left));
    for (std::size_t c = 0; c < static_cast<std::size_t>(job_.components); ++c) compute(head, c);
  }
}

void LowBand::compute(HeadIndex head, std::size_t c) {
  Corners corners;
  for (std::size_t k = 0; k < cell_count_; ++k) {
    const Corrections& at = at_[head][c];
    std::array<int, 4> v{at[cells_[k][0]], at[cells_[k][1]], at[cells_[k][2]], at[cells_[k][3]]};
    if (std::min(std::min(v[0], v[1]), std::min(v[2], v[3])) == kUnseen) fill_unseen(v);
    for (std::size_t i = 0; i < 4; ++i) corners[i][k] = v[i];
  }
  std::array<std::int16_t, 4>* const to = coefficients_[head][c].data();
  cell_bits_ == 0 ? fit_small_cells(corners, cell_count_, to) : fit_large_cells(corners, cell_count_, to);
}

/// Corners that the head does not see count as the mean of the others, or as 0.
void LowBand::fill_unseen(std::array<int, 4>& corners) {
  int seen = 0;
  int sum = 0;
  for (const int corner : corners) {
    if (corner == kUnseen) continue;
    ++seen;
    sum += corner;
  }
  std::ranges::replace(corners, int{kUnseen}, seen == 0 ? 0 : sum / seen);
}

}  // namespace nodal::blend
