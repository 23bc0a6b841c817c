// The blend's arithmetic, one number at a time: the specification, and the parts that are not worth vectorizing.
// Internal to stitch/blend. Everything is in an unnamed namespace on purpose: the file of each kernel compiles its own
// copy for its own instruction set.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "stitch/blend/blend_job.h"
#include "stitch/blend/low_band.h"

namespace nodal::blend {
namespace {

/// One component of a tile's 64 pixels, row by row.
using TileValues = std::array<std::int16_t, kTilePixels>;
using Weights = std::array<std::uint16_t, kTilePixels>;

inline std::int16_t wrap(int value) { return static_cast<std::int16_t>(static_cast<std::uint16_t>(value)); }

/// (a * b + 2^14) >> 15: the result of pmulhrsw and sqrdmulh.
inline std::int16_t mulr(std::int16_t a, std::int16_t b) { return wrap((a * b + (1 << 14)) >> 15); }

inline std::uint16_t quadratic_at(const Quadratic& q, int i, int j) {
  return static_cast<std::uint16_t>(q[0] + q[1] * i + q[2] * j + q[3] * i * j + q[4] * i * i + q[5] * j * j);
}
inline std::int16_t bilinear_at(const std::int16_t* q, int i, int j) {
  return wrap(q[0] + q[1] * i + q[2] * j + q[3] * i * j);
}

/// The curve's value at `at`; the low kBits of `at` are the fraction within a piece. See Pieces.
template <int kBits, std::size_t kPieces>
inline std::int16_t curve_at(const Pieces<kPieces>& curve, int at) {
  const auto i = static_cast<std::size_t>(at >> kBits) & (kPieces - 1);
  return wrap(curve.knot[i] + mulr(curve.rise[i], wrap(at << (15 - kBits))));
}

/// A pixel's coordinates in the patch, see PatchRecord.
struct Place {
  std::uint16_t x = 0;
  std::uint16_t y = 0;
};
inline Place place_of(const GridTable& grid, const PatchRecord& record, int i, int j) {
  if (!record.listed()) return {quadratic_at(record.x, i, j), quadratic_at(record.y, i, j)};
  const auto p = static_cast<std::size_t>(j * kTile + i);
  const std::uint16_t* list = grid.coordinates.data() + record.list() * 2 * kTilePixels;
  return {list[p], list[kTilePixels + p]};
}

/// Bilinear interpolation of sample (x, y) and its neighbours to the right and below. Pixels without weight can have
/// any coordinates; they are clamped to the picture.
inline int sample_at(const PlaneView& plane, const PatchRecord& record, Place at) {
  const int x = std::clamp(record.left + (at.x >> kFractionBits), 0, plane.width - 2);
  const int y = std::clamp(record.top + (at.y >> kFractionBits), 0, plane.height - 2);
  const std::uint8_t* s = plane.data + y * plane.row_stride + std::ptrdiff_t{x} * plane.pixel_stride;
  const int f = at.x >> (kFractionBits - 7) & 127;
  const int g = at.y & ((1 << kFractionBits) - 1);
  const std::uint8_t* below = s + plane.row_stride;
  const int top = s[0] * (128 - f) + s[plane.pixel_stride] * f;
  const int bottom = below[0] * (128 - f) + below[plane.pixel_stride] * f;
  return top - mulr(wrap(top - bottom), wrap(g << (15 - kFractionBits)));
}

/// The light that record r of `grid` contributes to component c of a pixel, negative.
inline std::int16_t negative_light_of(const BlendJob& job, const GridTable& grid, std::size_t r, std::size_t c,
                                      int sample, int i, int j) {
  const HeadIndex head = grid.records[r].head();
  const JobComponent& component = job.component[c];
  const int shown = job.curves ? curve_at<10>(job.curve[head][component.tone], sample) : sample;
  std::int16_t negative_light = wrap(component.black - shown);
  if (job.gains) {
    const std::int16_t head_gain = job.gain(head, c);
    const bool alone = grid.gains.empty();
    negative_light = mulr(negative_light, alone ? head_gain : mulr(bilinear_at(grid.gains[r].data(), i, j), head_gain));
  }
  if (job.low_band == nullptr || !job.low_band->corrects(head)) return negative_light;
  const int corrected = negative_light + mulr(bilinear_at(job.low_band->coefficients(head, c), i, j), LowBand::kUnit);
  return static_cast<std::int16_t>(std::clamp(corrected, -kMaxSample, kMaxSample));
}

inline std::uint8_t level_of(const BlendJob& job, std::size_t c, int light) {
  const JobComponent& component = job.component[c];
  if (!component.output_curve) {
    return static_cast<std::uint8_t>(std::clamp(component.black_level + mulr(wrap(light), component.scale), 0, 255));
  }
  const int shown = curve_at<9>(job.output[component.tone], std::max(light, 0));
  return static_cast<std::uint8_t>(std::clamp((shown + 64) >> kSampleBits, 0, 255));
}

/// Reads the weights of a tile's records, one record after the other.
class WeightReader {
 public:
  WeightReader(const GridTable& grid, const Tile& tile, std::size_t records)
      : how_(tile.how()),
        at_(grid.weights.data() + tile.weights()),
        record_(grid.records.data() + tile.record),
        end_(record_ + records) {
    rest_.fill(1 << kWeightBits);
  }

  /// The weights of the next record, row by row, 0 .. 1 << kWeightBits; 0 in the half of the tile that it does not
  /// have.
  void next(Weights& weights) {
    const PatchRecord& record = *record_++;
    if (record.has(0)) read(record_ + (record.paired() ? 1 : 0) == end_);
    for (std::size_t p = 0; p < kTilePixels; ++p) {
      weights[p] = record.has(p / (kTilePixels / 2)) ? weight_[p] : std::uint16_t{0};
    }
  }

 private:
  /// Reads the weights of a record or a pair.
  void read(bool last) {
    if (how_ == Sharing::kAlone || (last && how_ != Sharing::kOpen)) {
      weight_ = rest_;
      return;
    }
    for (std::size_t p = 0; p < kTilePixels; ++p) {
      const auto row = static_cast<int>(p / kTile);
      const int negative = how_ == Sharing::kBilinear ? bilinear_at(at_, static_cast<int>(p % kTile), row) : at_[p];
      weight_[p] = static_cast<std::uint16_t>(-negative);
      rest_[p] = static_cast<std::uint16_t>(rest_[p] + negative);
    }
    at_ += how_ == Sharing::kBilinear ? 4 : kTilePixels;
  }

  Sharing how_;
  const std::int16_t* at_;
  const PatchRecord* record_;
  const PatchRecord* end_;
  Weights rest_{};
  Weights weight_{};
};

/// Prefetches the patch `kAhead` records after r. Always kRows rows: a row count per record mispredicts and costs more
/// than the rows it saves. A row may span two cache lines; the patch to its left has nearly always fetched the first,
/// so only the second is fetched. Rows of groups of 3 or 4 are nearly a line long, so both lines are fetched.
/// Always inlined: GCC 12 assumes that a function of prefetches only has no effect, and drops the calls.
template <int N>
[[gnu::always_inline]] inline void prefetch(const BlendJob& job, std::size_t r) {
  constexpr std::size_t kAhead = 224;  // about 300 KiB; more is evicted from a level-2 cache of 1 MiB
  constexpr int kRows = 14;
  constexpr int kNear = 2;  // level 2: level 1 holds the data in use
  const auto& records = job.grid->records;
  const PatchRecord& record = records[std::min(r + kAhead, records.size() - 1)];
  const PatchPlane& plane = job.plane(record);
  const std::ptrdiff_t begin = record.top * plane.row_stride + std::ptrdiff_t{record.left} * plane.group;
  const std::ptrdiff_t end = begin + kPatch * plane.group - 1;
  const auto fetch_rows = [&](const std::uint8_t* from) __attribute__((always_inline)) {
    for (int y = 0; y < kRows; ++y, from += plane.row_stride) __builtin_prefetch(from, 0, kNear);
  };
  const bool both = plane.group > 2;
  for (std::size_t c = 0; c < (plane.layout == SampleLayout::kPlanar ? N : 1); ++c) {
    fetch_rows(plane.data[c] + end);
    if (both) fetch_rows(plane.data[c] + begin);
  }
}

/// The confidence in a head at each pixel of a record. `samples` are the pixels' own samples, by component, before any
/// curve.
inline void trust(const BlendJob& job, const GridTable& grid, const PatchRecord& record,
                  std::span<const TileValues> samples, std::array<std::uint8_t, kTilePixels>& trusted) {
  const auto& of_level = job.tone->confidence->of_level[record.head()];
  const bool chroma = job.component[0].component != 0;
  const PlaneView& luma = job.luma[static_cast<std::size_t>(record.pyramid_level())][record.head()];
  for (std::size_t j = 0; j < kTile; ++j) {
    for (std::size_t i = 0; i < kTile; ++i) {
      const std::size_t p = j * kTile + i;
      int level = 0;
      if (chroma) {
        const Place at = place_of(grid, record, static_cast<int>(i), static_cast<int>(j));
        const auto& shift = job.luma_shift[record.head()];
        const int x = std::min((record.left + (at.x >> kFractionBits)) << shift[0], luma.width - 1);
        const int y = std::min((record.top + (at.y >> kFractionBits)) << shift[1], luma.height - 1);
        level = luma.data[y * luma.row_stride + std::ptrdiff_t{x} * luma.pixel_stride];
      } else {
        for (const TileValues& component : samples) level = std::max(level, component[p] >> kSampleBits);
      }
      trusted[p] = of_level[static_cast<std::size_t>(level)];
    }
  }
}

}  // namespace
}  // namespace nodal::blend
