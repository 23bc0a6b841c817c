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

/// Black less the samples, as low_sample_at(). Of LowBand::kTogether sights, because whole registers are
/// faster: the numbers after the last sight are meaningless.
NODAL_CLONES void interpolate(const std::uint64_t* above, const std::uint64_t* below, const std::uint16_t* x,
                              const std::uint16_t* y, std::int16_t black, std::int16_t* light) {
  for (std::size_t k = 0; k < LowBand::kTogether; ++k) {
    const std::uint32_t f = x[k] & 255U;
    const std::uint32_t g = y[k] & 255U;
    const auto row = [&](std::uint64_t two) {
      const auto left = static_cast<std::uint32_t>(two) & 0xffffU;
      const auto right = static_cast<std::uint32_t>(two >> 32) & 0xffffU;
      return left * (256 - f) + right * f;
    };
    light[k] = wrap(black - static_cast<int>((row(above[k]) * (256 - g) + row(below[k]) * g + (1U << 15)) >> 16));
  }
}

/// Applies gains; an own gain of 0 stands for one.
NODAL_CLONES void apply_gains(const std::int16_t* own, const std::int16_t* head, std::int16_t* light) {
  for (std::size_t k = 0; k < LowBand::kTogether; ++k) {
    const std::int16_t both = mulr(own[k], head[k]);
    light[k] = mulr(light[k], own[k] == 0 ? head[k] : both);
  }
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

/// Corners that the head does not see (`unseen`) count as the mean of the others, rounded towards 0, or as 0.
NODAL_CLONES void fill_unseen(Corners& corners, std::size_t cells, std::int32_t unseen) {
  for (std::size_t k = 0; k < cells; ++k) {
    std::int32_t sum = 0;
    std::int32_t seen = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      sum += corners[i][k] == unseen ? 0 : corners[i][k];
      seen += corners[i][k] == unseen ? 0 : 1;
    }
    // 1 / seen in 1 / (1 << 17), rounded up: exact for sums of up to three corrections.
    const std::uint32_t share = seen == 3 ? 43691 : seen == 2 ? 65536 : seen == 1 ? 131072 : 0;
    const auto size = static_cast<std::int32_t>(static_cast<std::uint32_t>(sum < 0 ? -sum : sum) * share >> 17);
    const std::int32_t mean = sum < 0 ? -size : size;
    for (std::size_t i = 0; i < 4; ++i) corners[i][k] = corners[i][k] == unseen ? mean : corners[i][k];
  }
}

std::int64_t floor_div(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }

}  // namespace

LowBand::LowBand(const BlendJob& job)
    : job_(job),
      grid_(*job.grid),
      components_(static_cast<std::size_t>(job.components)),
      cell_bits_(grid_.low.cell_tiles == 2 ? 1 : 0),
      cell_count_(static_cast<std::size_t>(grid_.low_cells_across() * grid_.low_cells_down())) {
  for (std::size_t h = 0; h < kMaxHeads; ++h) {
    for (std::size_t c = 0; c < components_; ++c) {
      const PlaneView& plane = job.low[h].planes[static_cast<std::size_t>(job.component[c].component)];
      low_[h].data[c] = plane.data;
      low_[h].row_stride = plane.row_stride;
    }
  }
}

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

/// Finds where a block's sights lie in the low pictures, and fetches their samples: low pictures of many heads do not
/// stay in the level-2 cache while a block is blended.
void LowBand::locate(std::size_t block) {
  const LowGrid& low = grid_.low;
  const std::size_t first = low.first_sight[low.first_point[block]];
  const std::size_t count = low.first_sight[low.first_point[block + 1]] - first;
  const LowSight* sights = low.sights.data() + first;
  for (std::size_t k = 0; k < count; ++k) {
    const Place& place = low_[sights[k].head];
    constexpr std::ptrdiff_t kStep = sizeof(LowSample);
    const std::ptrdiff_t offset = (sights[k].y >> 8) * place.row_stride + kStep * (sights[k].x >> 8);
    offset_[k] = static_cast<std::int32_t>(offset);
    for (std::size_t c = 0; c < components_; ++c) __builtin_prefetch(place.data[c] + offset);
  }
  located_ = block;
}

/// Computes the light of `count` sights of the block from its sight `first` on.
void LowBand::look_at_sights(std::size_t first, std::size_t count) {
  const bool gains = job_.gains;
  const LowSight* sights = grid_.low.sights.data() + grid_.low.first_sight[first_point_] + first;
  for (std::size_t k = 0; k < count; ++k) {
    const LowSight& sight = sights[k];
    const Place& place = low_[sight.head];
    for (std::size_t c = 0; c < components_; ++c) {
      const std::uint8_t* at = place.data[c] + offset_[first + k];  // low pictures repeat their edges: kMoreLowSamples
      std::memcpy(&looks_.above[c][k], at, 2 * sizeof(LowSample));
      std::memcpy(&looks_.below[c][k], at + place.row_stride, 2 * sizeof(LowSample));
      if (gains) looks_.head_gain[c][k] = job_.gain(sight.head, c);
    }
    looks_.x[k] = sight.x;
    looks_.y[k] = sight.y;
    looks_.own_gain[k] = sight.gain;
  }
  for (std::size_t c = 0; c < components_; ++c) {
    std::int16_t* light = light_[c].data() + first;
    const std::int16_t black = job_.component[c].black;
    interpolate(looks_.above[c].data(), looks_.below[c].data(), looks_.x.data(), looks_.y.data(), black, light);
    for (std::size_t k = 0; job_.curves && k < count; ++k) {
      light[k] = wrap(black - curve_at<10>(job_.curve[sights[k].head][job_.component[c].tone], black - light[k]));
    }
    if (gains) apply_gains(looks_.own_gain.data(), looks_.head_gain[c].data(), light);
  }
}

/// Computes the corrections at all points of the block, with full confidence in all heads: weights sum to one, and 32
/// bits suffice. Where one head sees a point, its light is the mean.
void LowBand::correct(std::size_t first, std::size_t count, std::size_t points) {
  const LowGrid& low = grid_.low;
  const LowSight* sights = low.sights.data() + first;
  // Written past the end of each point's sights, which the next point then corrects: without branches.
  for (std::size_t p = 0; p < points; ++p) {
    std::memset(point_.data() + (low.first_sight[first_point_ + p] - first), static_cast<int>(p), kMaxHeads);
  }
  for (std::size_t s = 0; s < count; s += kTogether) look_at_sights(s, std::min(count - s, kTogether));
  for (std::size_t c = 0; c < components_; ++c) {
    const std::int16_t* light = light_[c].data();
    std::array<std::int32_t, GridTable::kMaxLowPoints> mean{};
    for (std::size_t s = 0; s < count; ++s) mean[point_[s]] += sights[s].weight * light[s];
    for (std::size_t p = 0; p < points; ++p) mean[p] = (mean[p] + (1 << (kWeightBits - 1))) >> kWeightBits;
    for (std::size_t s = 0; s < count; ++s) {
      const std::int32_t full = std::clamp(mean[point_[s]] - light[s], -kMaxCorrection, kMaxCorrection);
      at_[sights[s].head][c][point_[s]] = static_cast<std::int16_t>(full);
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
  if (end - begin == 1) {  // there is nothing to compare with
    for (std::size_t c = 0; c < components_; ++c) at_[low.sights[begin].head][c][point - first_point_] = 0;
    return;
  }
  const auto missing = [&](std::size_t s) { return (job_.missing >> low.sights[s].head & 1) != 0; };
  for (std::size_t s = begin; s < end; ++s) {
    if (missing(s)) continue;
    const LowSight& sight = low.sights[s];
    sure[s - begin] = confidence(sight);
    const std::int64_t weight = std::int64_t{sight.weight} * sure[s - begin];
    weights += weight;
    for (std::size_t c = 0; c < components_; ++c) {
      light[s - begin][c] = negative_light(sight, c);
      sum[c] += weight * light[s - begin][c];
    }
  }
  if (weights == 0) return;
  for (std::size_t c = 0; c < components_; ++c) {
    const std::int64_t mean = weights == kSure << kWeightBits
                                  ? (sum[c] / kSure + (1 << (kWeightBits - 1))) >> kWeightBits
                                  : floor_div(2 * sum[c] + weights, 2 * weights);
    for (std::size_t s = begin; s < end; ++s) {
      if (missing(s)) continue;
      const std::int64_t full = std::clamp<std::int64_t>(mean - light[s - begin][c], -kMaxCorrection, kMaxCorrection);
      at_[low.sights[s].head][c][point - first_point_] = static_cast<std::int16_t>(full * sure[s - begin] / kSure);
    }
  }
}

void LowBand::begin_block(std::size_t block) {
  const LowGrid& low = grid_.low;
  first_point_ = low.first_point[block];
  const std::size_t points = low.first_point[block + 1] - first_point_;
  const std::uint32_t* first_sight = low.first_sight.data() + first_point_;
  cells_ = low.cells.data() + block * cell_count_;
  corrected_.fill(0);
  std::uint32_t most = 0;  // sights of a point
  for (std::size_t p = 0; p < points; ++p) most = std::max(most, first_sight[p + 1] - first_sight[p]);
  if (most < 2) return;  // there is nothing to compare with
  std::uint32_t seen = 0;
  for (std::size_t s = first_sight[0]; s < first_sight[points]; ++s) seen |= 1U << low.sights[s].head;
  for (std::uint32_t left = seen; left != 0; left &= left - 1) {
    for (std::size_t c = 0; c < components_; ++c) {
      std::fill_n(at_[static_cast<std::size_t>(std::countr_zero(left))][c].begin(), points, kUnseen);
    }
  }
  if (job_.careful || job_.missing != 0) {  // tiles may also need the heads of their cover
    for (std::size_t p = 0; p < points; ++p) correct_carefully(first_point_ + p);
  } else {
    if (located_ != block) locate(block);
    correct(first_sight[0], first_sight[points] - first_sight[0], points);
    if (block + 2 < low.first_point.size()) locate(block + 1);
    seen &= heads_of(block);
  }
  for (; seen != 0; seen &= seen - 1) compute(static_cast<HeadIndex>(std::countr_zero(seen)));
}

/// One bit for each head that a tile of the block shows: between narrow transitions, some of those that see it.
std::uint32_t LowBand::heads_of(std::size_t block) const {
  const auto tiles = static_cast<std::size_t>(GridTable::kBlockTiles * grid_.block_rows());
  std::uint32_t heads = 0;
  for (std::size_t r = grid_.tiles[block * tiles].record; r < grid_.tiles[(block + 1) * tiles].record; ++r) {
    heads |= 1U << grid_.records[r].head();
  }
  return heads;
}

/// Computes a head's coefficients in the block.
void LowBand::compute(HeadIndex head) {
  std::uint64_t corrected = 0;  // cells
  for (std::size_t c = 0; c < components_; ++c) {
    const Corrections& at = at_[head][c];
    Corners corners;
    bool unseen = false;
    for (std::size_t k = 0; k < cell_count_; ++k) {
      const std::array<std::int16_t, 4> v{at[cells_[k][0]], at[cells_[k][1]], at[cells_[k][2]], at[cells_[k][3]]};
      unseen |= std::min(std::min(v[0], v[1]), std::min(v[2], v[3])) == kUnseen;
      for (std::size_t i = 0; i < 4; ++i) corners[i][k] = v[i];
    }
    if (unseen) fill_unseen(corners, cell_count_, kUnseen);
    for (std::size_t k = 0; k < cell_count_; ++k) {
      const bool any = (corners[0][k] | corners[1][k] | corners[2][k] | corners[3][k]) != 0;
      corrected |= static_cast<std::uint64_t>(any) << k;
    }
    std::array<std::int16_t, 4>* const to = coefficients_[head][c].data();
    cell_bits_ == 0 ? fit_small_cells(corners, cell_count_, to) : fit_large_cells(corners, cell_count_, to);
  }
  for (std::size_t part = 0; part < (cell_bits_ == 0 ? 1U : 4U); ++part) {
    corrected_[head] |= corrected << (part * cell_count_);
  }
}

}  // namespace nodal::blend
