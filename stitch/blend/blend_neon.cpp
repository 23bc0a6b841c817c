// The blend for NEON: two rows of a tile at a time. `tbl` picks their samples from four rows of the patch at a time,
// until all the rows that they need have been covered.
#include <arm_neon.h>

#include <algorithm>
#include <array>

#include "stitch/blend/tile_driver.h"

namespace nodal::blend {
namespace {

using Row = int16x8_t;  ///< one row of a tile

/// Row j of a tile, from a list of 64 values, one per pixel.
template <class Number>
inline Row listed_row(const Number* values, std::size_t j) {
  return vld1q_s16(reinterpret_cast<const std::int16_t*>(values) + j * kTile);
}

inline Row columns() {
  constexpr std::array<std::int16_t, 8> kColumns{0, 1, 2, 3, 4, 5, 6, 7};
  return vld1q_s16(kColumns.data());
}

using TileRows = std::array<Row, kTile>;

/// A quadratic over a tile; each row is the row above plus a difference.
inline TileRows over_tile(const Quadratic& q) {
  const Row i = columns();
  TileRows rows;
  Row value = vmlaq_n_s16(vmlaq_n_s16(vdupq_n_s16(q[0]), i, q[1]), vmulq_s16(i, i), q[4]);
  Row step = vaddq_s16(vmlaq_n_s16(vdupq_n_s16(q[2]), i, q[3]), vdupq_n_s16(q[5]));
  const Row bend = vshlq_n_s16(vdupq_n_s16(q[5]), 1);
  for (Row& row : rows) {
    row = value;
    value = vaddq_s16(value, step);
    step = vaddq_s16(step, bend);
  }
  return rows;
}

/// A bilinear polynomial: coefficients of 1, i, j, ij.
inline TileRows bilinear_over_tile(const std::int16_t* q) { return over_tile({q[0], q[1], q[2], q[3], 0, 0}); }

struct Coordinates {
  TileRows x;
  TileRows y;
};
inline Coordinates coordinates_of(const GridTable& grid, const PatchRecord& record) {
  if (!record.listed()) return {over_tile(record.x), over_tile(record.y)};
  const std::uint16_t* list = grid.coordinates.data() + record.list() * 2 * kTilePixels;
  Coordinates at;
  for (std::size_t j = 0; j < kTile; ++j) {
    at.x[j] = listed_row(list, j);
    at.y[j] = listed_row(list + kTilePixels, j);
  }
  return at;
}

/// A patch: its first row, and the distance between its rows in bytes.
struct Patch {
  const std::uint8_t* data = nullptr;
  std::ptrdiff_t stride = 0;
};
template <int N>
using Staged = std::array<std::array<std::uint8_t, kPatch * kPatch>, N>;

/// Copies every component's samples to contiguous rows.
template <int N>
inline void stage(const PatchPlane& plane, const PatchRecord& record, int rows, Staged<N>& staged) {
  const std::uint8_t* from = plane.data[0] + record.top * plane.row_stride + std::ptrdiff_t{record.left} * plane.group;
  for (int y = 0; y < rows; ++y, from += plane.row_stride) {
    std::array<uint8x16_t, 4> apart{};  // by offset in the group
    switch (plane.layout) {
      case SampleLayout::kPairs: {
        const uint8x16x2_t row = vld2q_u8(from);
        apart = {row.val[0], row.val[1]};
        break;
      }
      case SampleLayout::kTriples: {
        const uint8x16x3_t row = vld3q_u8(from);
        apart = {row.val[0], row.val[1], row.val[2]};
        break;
      }
      case SampleLayout::kQuads: {
        const uint8x16x4_t row = vld4q_u8(from);
        apart = {row.val[0], row.val[1], row.val[2], row.val[3]};
        break;
      }
      default: break;
    }
    for (std::size_t c = 0; c < N; ++c) vst1q_u8(staged[c].data() + y * kPatch, apart[plane.offset[c] & 3]);
  }
}

/// The same for any layout, sample by sample.
template <int N>
inline void stage_anyhow(const PatchPlane& plane, const PatchRecord& record, int rows, Staged<N>& staged) {
  for (std::size_t c = 0; c < N; ++c) {
    const PlaneView& view = plane.views[c];
    staged[c].fill(0);
    for (int y = 0; y < std::min(rows, view.height - record.top); ++y) {
      const std::uint8_t* from = view.data + (record.top + y) * view.row_stride;
      for (int x = 0; x < std::min(kPatch, view.width - record.left); ++x) {
        staged[c][static_cast<std::size_t>(y * kPatch + x)] = from[std::ptrdiff_t{record.left + x} * view.pixel_stride];
      }
    }
  }
}

template <int N>
inline void find_patch(const PatchPlane& plane, const PatchRecord& record, Staged<N>& staged,
                       std::array<Patch, N>& patch) {
  const int rows = record.last_row() + 2;
  if (plane.layout == SampleLayout::kGeneral) {
    stage_anyhow<N>(plane, record, rows, staged);
  } else if (plane.layout != SampleLayout::kPlanar) {
    stage<N>(plane, record, rows, staged);
  }
  for (std::size_t c = 0; c < N; ++c) {
    patch[c] = {staged[c].data(), kPatch};
    if (plane.layout == SampleLayout::kPlanar) {
      patch[c] = {plane.data[c] + record.top * plane.row_stride + record.left, plane.row_stride};
    }
  }
}

/// The patch coordinates of two rows of a tile, in the form that interpolation needs.
struct Places {
  uint8x16_t place;         ///< row * 16 + column of the upper left sample
  uint8x16_t right;         ///< the right sample's share, in 1/128
  std::array<Row, 2> down;  ///< the lower sample's share, in 1/2^15
  int first = 0;            ///< first and last patch row that is an upper sample row
  int last = 0;
};
/// Pixels with weight use patch rows first .. last; pixels without weight can have any coordinates.
inline Places places_of(const Coordinates& at, std::size_t j, int first, int last) {
  const auto pack = [](uint16x8_t a, uint16x8_t b) { return vcombine_u8(vmovn_u16(a), vmovn_u16(b)); };
  std::array<uint16x8_t, 2> x, y;
  for (std::size_t k = 0; k < 2; ++k) {
    x[k] = vreinterpretq_u16_s16(at.x[j + k]);
    y[k] = vreinterpretq_u16_s16(at.y[j + k]);
  }
  const uint8x16_t row = pack(vshrq_n_u16(y[0], kFractionBits), vshrq_n_u16(y[1], kFractionBits));
  const uint8x16_t column = pack(vshrq_n_u16(x[0], kFractionBits), vshrq_n_u16(x[1], kFractionBits));
  Places places;
  places.place = vsliq_n_u8(column, row, 4);
  places.right =
      vandq_u8(pack(vshrq_n_u16(x[0], kFractionBits - 7), vshrq_n_u16(x[1], kFractionBits - 7)), vdupq_n_u8(127));
  const auto share = [](uint16x8_t of) {
    return vreinterpretq_s16_u16(vandq_u16(vshlq_n_u16(of, 15 - kFractionBits), vdupq_n_u16(0x7ff8)));
  };
  places.down = {share(y[0]), share(y[1])};
  places.first = std::max<int>(first, vminvq_u8(row));
  places.last = std::min<int>(last, vmaxvq_u8(row));
  return places;
}

/// Interpolates the samples of two rows of a tile.
inline std::array<Row, 2> mix(const Patch& patch, const Places& at) {
  uint8x16_t p00 = vdupq_n_u8(0), p10 = p00, p01 = p00, p11 = p00;
  for (int y = at.first; y <= at.last; y += 4) {
    // Loads rows y .. y + 4, but none below row last + 1: that may be the last row of the picture.
    std::array<uint8x16_t, 5> rows;
    const std::uint8_t* from = patch.data + y * patch.stride;
    for (int k = 0; k < 5; ++k) {
      rows[static_cast<std::size_t>(k)] = vld1q_u8(from);
      if (y + k <= at.last) from += patch.stride;
    }
    // Indices of other rows are out of the range of tbx, which then leaves the byte unchanged.
    const uint8x16_t left = vsubq_u8(at.place, vdupq_n_u8(static_cast<std::uint8_t>(y << 4)));
    const uint8x16_t right = vaddq_u8(left, vdupq_n_u8(1));
    const uint8x16x4_t upper{{rows[0], rows[1], rows[2], rows[3]}};
    const uint8x16x4_t lower{{rows[1], rows[2], rows[3], rows[4]}};
    p00 = vqtbx4q_u8(p00, upper, left);
    p10 = vqtbx4q_u8(p10, upper, right);
    p01 = vqtbx4q_u8(p01, lower, left);
    p11 = vqtbx4q_u8(p11, lower, right);
  }
  const uint8x16_t mine = vsubq_u8(vdupq_n_u8(128), at.right);
  const auto across = [&](uint8x16_t a, uint8x16_t b, std::size_t k) {
    const auto half = [k](uint8x16_t v) { return k == 0 ? vget_low_u8(v) : vget_high_u8(v); };
    return vreinterpretq_s16_u16(vmlal_u8(vmull_u8(half(a), half(mine)), half(b), half(at.right)));
  };
  std::array<Row, 2> sample;
  for (std::size_t k = 0; k < 2; ++k) {
    const Row top = across(p00, p10, k);
    const Row bottom = across(p01, p11, k);
    sample[k] = vsubq_s16(top, vqrdmulhq_s16(vsubq_s16(top, bottom), at.down[k]));
  }
  return sample;
}

/// Looks up bytes in a table; every index is less than its length.
inline uint8x16_t look_up(const std::array<std::uint8_t, 32>& of, uint8x16_t index) {
  return vqtbl2q_u8({{vld1q_u8(of.data()), vld1q_u8(of.data() + 16)}}, index);
}
inline uint8x16_t look_up(const std::array<std::uint8_t, 64>& of, uint8x16_t index) {
  return vqtbl4q_u8(
      {{vld1q_u8(of.data()), vld1q_u8(of.data() + 16), vld1q_u8(of.data() + 32), vld1q_u8(of.data() + 48)}}, index);
}

/// The curve's values for two rows, see curve_at.
template <int kBits, std::size_t kPieces>
inline std::array<Row, 2> on_curve(const std::array<Row, 2>& at, const Pieces<kPieces>& curve) {
  const auto piece_of = [](Row of) { return vmovn_u16(vshrq_n_u16(vreinterpretq_u16_s16(of), kBits)); };
  const uint8x16_t piece = vcombine_u8(piece_of(at[0]), piece_of(at[1]));
  const auto numbers = [&](std::size_t k) {
    const uint8x16_t low = look_up(curve.bytes[k], piece), high = look_up(curve.bytes[k + 1], piece);
    return std::array<Row, 2>{vreinterpretq_s16_u8(vzip1q_u8(low, high)), vreinterpretq_s16_u8(vzip2q_u8(low, high))};
  };
  const std::array<Row, 2> knot = numbers(0), rise = numbers(2);
  std::array<Row, 2> value;
  for (std::size_t k = 0; k < 2; ++k) {
    const Row fraction = vshlq_n_s16(at[k], 15 - kBits);
    value[k] = vaddq_s16(knot[k], vqrdmulhq_s16(rise[k], fraction));
  }
  return value;
}

struct Neon {
  /// The light that a record contributes to the tile's halves [kBegin, kEnd), negative.
  template <int N, std::size_t kBegin, std::size_t kEnd>
  static inline void negative_light_of(const BlendJob& job, std::size_t r, std::array<TileRows, N>& negative_light) {
    const PatchRecord& record = job.grid->records[r];
    Staged<N> staged;
    std::array<Patch, N> patch;
    find_patch<N>(job.plane(record), record, staged, patch);
    const Coordinates at = coordinates_of(*job.grid, record);
    const bool alone = job.grid->gains.empty();
    const TileRows vignetting = !job.gains || alone ? TileRows{} : bilinear_over_tile(job.grid->gains[r].data());
    for (std::size_t j = kBegin * kQuarter; j < kEnd * kQuarter; j += 2) {
      const int first = record.first_row(j / kQuarter);
      const Places places = places_of(at, j, first, record.last_row());
      for (std::size_t c = 0; c < N; ++c) {
        std::array<Row, 2> sample = mix(patch[c], places);
        if (job.curves) sample = on_curve<10>(sample, job.curve[record.head()][job.component[c].tone]);
        for (std::size_t k = 0; k < 2; ++k) {
          Row value = vsubq_s16(vdupq_n_s16(job.component[c].black), sample[k]);
          if (job.gains) {
            const Row head = vdupq_n_s16(job.gain(record.head(), c));
            value = vqrdmulhq_s16(value, alone ? head : vqrdmulhq_s16(vignetting[j + k], head));
          }
          negative_light[c][j + k] = value;
        }
      }
    }
  }

  /// Adds the correction of the head's low frequencies.
  template <int N>
  static inline void correct(const BlendJob& job, HeadIndex head, std::array<TileRows, N>& negative_light) {
    if (!job.low_band->corrects(head)) return;
    for (std::size_t c = 0; c < N; ++c) {
      const TileRows by = bilinear_over_tile(job.low_band->coefficients(head, c));
      for (std::size_t j = 0; j < kTile; ++j) {
        const Row sum = vqaddq_s16(negative_light[c][j], vqrdmulhq_s16(by[j], vdupq_n_s16(LowBand::kUnit)));
        negative_light[c][j] = vmaxq_s16(vminq_s16(sum, vdupq_n_s16(kMaxSample)), vdupq_n_s16(-kMaxSample));
      }
    }
  }

  template <int N>
  static inline void finish(const BlendJob& job, const std::array<TileRows, N>& light, bool negative,
                            std::uint8_t* out) {
    for (std::size_t c = 0; c < N; ++c) {
      const JobComponent& component = job.component[c];
      for (std::size_t j = 0; j < kTile; j += 2) {
        std::array<Row, 2> level{light[c][j], light[c][j + 1]};
        if (component.output_curve) {
          for (Row& row : level) row = vmaxq_s16(negative ? vnegq_s16(row) : row, vdupq_n_s16(0));
          level = on_curve<9>(level, job.output[component.tone]);
          for (Row& row : level) row = vrshrq_n_s16(row, kSampleBits);
        } else {
          const Row scale = vdupq_n_s16(negative ? component.negative_scale : component.scale);
          for (Row& row : level) row = vaddq_s16(vqrdmulhq_s16(row, scale), vdupq_n_s16(component.black_level));
        }
        vst1q_u8(out + c * kStrip + j * kTile, vcombine_u8(vqmovun_s16(level[0]), vqmovun_s16(level[1])));
      }
    }
  }

  /// For 16-bit raymaps: light is stored as it is.
  template <int N>
  static inline void finish(const BlendJob&, const std::array<TileRows, N>& light, bool negative, std::int16_t* out) {
    for (std::size_t c = 0; c < N; ++c) {
      for (std::size_t j = 0; j < kTile; ++j) {
        vst1q_s16(out + c * kStrip + j * kTile, negative ? vnegq_s16(light[c][j]) : light[c][j]);
      }
    }
  }

  template <int N, class Number>
  static inline void tile(const BlendJob& job, const Tile& tile, std::size_t records, Number* out) {
    std::array<TileRows, N> negative_light;
    const Sharing how = tile.how();
    if (records != 0 && how == Sharing::kAlone) {
      next_light<Neon, N>(job, tile.record, negative_light);
      return finish<N>(job, negative_light, true, out);
    }
    std::array<TileRows, N> light;
    for (TileRows& rows : light) rows.fill(vdupq_n_s16(0));
    const std::int16_t* weights = job.grid->weights.data() + tile.weights();
    TileRows rest;
    rest.fill(vdupq_n_s16(-32768));
    for (std::size_t r = tile.record, end = r + records; r < end;) {
      r += next_light<Neon, N>(job, r, negative_light);
      TileRows weight = rest;
      if (r < end || how == Sharing::kOpen) {
        if (how == Sharing::kBilinear) {
          weight = bilinear_over_tile(weights);
          weights += 4;
        } else {
          for (std::size_t j = 0; j < kTile; ++j) weight[j] = listed_row(weights, j);
          weights += kTilePixels;
        }
        for (std::size_t j = 0; j < kTile; ++j) rest[j] = vsubq_s16(rest[j], weight[j]);
      }
      for (std::size_t c = 0; c < N; ++c) {
        for (std::size_t j = 0; j < kTile; ++j) {
          light[c][j] = vaddq_s16(light[c][j], vqrdmulhq_s16(negative_light[c][j], weight[j]));
        }
      }
    }
    finish<N>(job, light, false, out);
  }

  template <int N>
  static void samples(const BlendJob& job, const GridTable& grid, const PatchRecord& record,
                      std::array<TileValues, N>& samples) {
    Staged<N> staged;
    std::array<Patch, N> patch;
    find_patch<N>(job.plane(record), record, staged, patch);
    const Coordinates at = coordinates_of(grid, record);
    for (std::size_t j = 0; j < kTile; j += 2) {
      const int first = record.first_row(j / kQuarter);
      const Places places = places_of(at, j, first, record.last_row());
      for (std::size_t c = 0; c < N; ++c) {
        const std::array<Row, 2> sample = mix(patch[c], places);
        for (std::size_t k = 0; k < 2; ++k) vst1q_s16(samples[c].data() + (j + k) * kTile, sample[k]);
      }
    }
  }

  static void put(std::uint8_t* to, const std::uint8_t* from, std::size_t bytes) { std::memcpy(to, from, bytes); }

  template <int N>
  static bool emit(const BlendJob& job, int x, int y, const std::uint8_t* strip, const RowEnds&) {
    const bool triples = N == 3 && interleaved(job);
    const bool pairs = N == 2 && paired(job);
    if (!triples && !pairs && job.out[0].pixel_stride != 1) return false;
    for (std::size_t j = 0; j < kTile; ++j) {
      const auto eight = [&](std::size_t c, std::size_t tile) {
        return vld1_u8(strip + c * kStrip + tile * kTilePixels + j * kTile);
      };
      const std::ptrdiff_t row = y + static_cast<std::ptrdiff_t>(j);
      for (std::size_t k = 0; k < 8; ++k) {
        const std::ptrdiff_t column = x + static_cast<std::ptrdiff_t>(k * kTile);
        if (triples) {
          vst3_u8(job.out[0].data + row * job.out[0].row_stride + 3 * column,
                  {{eight(0, k), eight(N / 2, k), eight(N - 1, k)}});
        } else if (pairs) {
          vst2_u8(job.out[0].data + row * job.out[0].row_stride + 2 * column, {{eight(0, k), eight(N - 1, k)}});
        } else {
          for (std::size_t c = 0; c < N; ++c)
            vst1_u8(job.out[c].data + row * job.out[c].row_stride + column, eight(c, k));
        }
      }
    }
    return true;
  }
};

}  // namespace

void blend_neon(const BlendJob& job) { blend_by<Neon>(job); }

}  // namespace nodal::blend
