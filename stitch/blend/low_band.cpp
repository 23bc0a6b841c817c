#include "stitch/blend/low_band.h"

#include <algorithm>
#include <cstring>

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

std::int64_t floor_div(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }

}  // namespace

LowBand::LowBand(const BlendJob& job) : job_(job), grid_(*job.grid) {}

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

void LowBand::correct(std::size_t point) {
  const LowGrid& low = grid_.low;
  const std::size_t begin = low.first_sight[point];
  const std::size_t end = low.first_sight[point + 1];
  if (end - begin == 1) {  // there is nothing to compare with
    for (std::size_t c = 0; c < static_cast<std::size_t>(job_.components); ++c) {
      at_[low.sights[begin].head][c][point - first_point_] = 0;
    }
    return;
  }
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
      at_[low.sights[s].head][c][point - first_point_] = static_cast<std::int16_t>(full * sure[s - begin] / kSure);
    }
  }
}

void LowBand::begin_block(std::size_t block) {
  const LowGrid& low = grid_.low;
  first_point_ = low.first_point[block];
  const std::size_t last = low.first_point[block + 1];
  cells_ = low.cells.data() + block * static_cast<std::size_t>(grid_.low_cells_across() * grid_.low_cells_down());
  seen_ = 0;
  for (std::size_t s = low.first_sight[first_point_]; s < low.first_sight[last]; ++s) {
    seen_ |= 1U << low.sights[s].head;
  }
  for (std::size_t h = 0; h < kMaxHeads; ++h) {
    if ((seen_ >> h & 1) == 0) continue;
    for (std::size_t c = 0; c < static_cast<std::size_t>(job_.components); ++c) {
      std::fill_n(at_[h][c].begin(), last - first_point_, kUnseen);
    }
  }
  for (std::size_t point = first_point_; point < last; ++point) correct(point);
}

void LowBand::begin_tile(int column, int row) {
  const int tiles = grid_.low.cell_tiles;
  corners_ = cells_[row / tiles * grid_.low_cells_across() + column / tiles].data();
  quadrant_x_ = column % tiles;
  quadrant_y_ = row % tiles;
  done_ = 0;
  moved_ = 0;
}

const std::int16_t* LowBand::coefficients(HeadIndex head) {
  if ((seen_ >> head & 1) == 0) return nullptr;
  if ((done_ >> head & 1) == 0) compute(head);
  return (moved_ >> head & 1) != 0 ? coefficients_[head].data() : nullptr;
}

void LowBand::compute(HeadIndex head) {
  done_ |= 1U << head;
  for (std::size_t c = 0; c < static_cast<std::size_t>(job_.components); ++c) {
    const Corrections& at = at_[head][c];
    std::array<int, 4> v{at[corners_[0]], at[corners_[1]], at[corners_[2]], at[corners_[3]]};
    std::int16_t* q = coefficients_[head].data() + 4 * c;
    std::fill_n(q, 4, std::int16_t{0});
    if ((v[0] | v[1] | v[2] | v[3]) == 0) continue;
    if (std::ranges::find(v, kUnseen) != v.end()) fill_unseen(v);
    moved_ |= 1U << head;
    // Of pixel centres, in half pixels from the cell's corner. A cell is 8 << k pixels wide; products are scaled by its
    // square, so that each coefficient is rounded once.
    const int bits = grid_.low.cell_tiles == 2 ? 4 : 3;
    const int x = 16 * quadrant_x_ + 1;
    const int y = 16 * quadrant_y_ + 1;
    const int across = v[1] - v[0];
    const int down = v[2] - v[0];
    const int both = v[3] - v[2] - across;
    const auto rounded = [](int value, int shift) {
      return static_cast<std::int16_t>((value + (1 << shift >> 1)) >> shift);
    };
    q[0] = rounded((v[0] << (2 * bits + 2)) + ((across * x + down * y) << (bits + 1)) + both * x * y, 2 * bits);
    q[1] = rounded((across << (bits + 1)) + both * y, 2 * bits - 1);
    q[2] = rounded((down << (bits + 1)) + both * x, 2 * bits - 1);
    q[3] = rounded(both, 2 * bits - 2);
  }
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
