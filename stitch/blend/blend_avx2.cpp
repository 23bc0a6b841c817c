// The blend for AVX2. A tile is processed in quarters, two side by side: the patch rows that a quarter needs are loaded
// one after the other, and a byte shuffle of each row picks the samples of the pixels that use it. A quarter is as wide
// as it is high, so seven rows nearly always suffice, whatever the head's rotation. Of the two rows that a pixel
// interpolates, one is even and one is odd; samples are kept by that parity, so that each row is shuffled only once.
#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <span>

#include "stitch/blend/blend_job.h"
#include "stitch/blend/low_band.h"
#include "stitch/blend/target.h"

NODAL_TARGET_BEGIN("avx2")

#include "stitch/blend/patch_avx2.h"
#include "stitch/blend/places_avx2.h"
#include "stitch/blend/tile_driver.h"
#include "stitch/blend/triples_avx2.h"

namespace nodal::blend {
namespace {

/// For every pixel, two horizontally adjacent samples.
struct Pair {
  V left, right;
};
/// For every pixel of half a tile, its four samples: those of its even row and those of its odd row, counted from the
/// first row of its quarter. Either may be the upper row.
struct Samples {
  Pair even, odd;
};

/// Picks the samples from `span` patch rows and the row below them. Row y is taken for every pixel whose upper row is
/// at least y - 1; for pixels further down, later rows overwrite it.
template <class Span>
[[gnu::always_inline]] inline Samples picked(const Constants& k, const Patch& patch, const Places& at,
                                             const PatchRecord& record, std::size_t half, Span span) {
  const std::uint8_t* left_at = patch.data + record.first_row(half, 0) * patch.stride;
  const std::uint8_t* right_at = patch.data + record.first_row(half, 1) * patch.stride;
  const V right = _mm256_add_epi8(at.column, load(&k.one));
  const auto row = [&](int y) __attribute__((always_inline))->Pair {
    const auto* lower = reinterpret_cast<const __m128i*>(left_at + y * patch.stride);
    const auto* upper = reinterpret_cast<const __m128i*>(right_at + y * patch.stride);
    const V both = _mm256_inserti128_si256(_mm256_castsi128_si256(_mm_loadu_si128(lower)), _mm_loadu_si128(upper), 1);
    return {_mm256_shuffle_epi8(both, at.column), _mm256_shuffle_epi8(both, right)};
  };
  Samples samples{row(0), row(1)};
  const auto take = [&](Pair & taken, int y) __attribute__((always_inline)) {
    const V reached = _mm256_cmpgt_epi8(at.row, load(&k.before[static_cast<std::size_t>(y)]));
    const Pair of = row(y);
    taken = {_mm256_blendv_epi8(taken.left, of.left, reached), _mm256_blendv_epi8(taken.right, of.right, reached)};
  };
  for (int y = 2; y < span; y += 2) {
    take(samples.even, y);
    take(samples.odd, y + 1);
  }
  if (span % 2 == 0) take(samples.even, span);
  return samples;
}

/// base - sample for half a tile; base is 128 times black.
[[gnu::always_inline]] inline Rows mix(const Constants& k, const Patch& patch, const Places& at,
                                       const PatchRecord& record, std::size_t half, V base) {
  using Least = std::integral_constant<int, kMinSpan>;
  const Samples s = record.span() == kMinSpan ? picked(k, patch, at, record, half, Least())
                                              : picked(k, patch, at, record, half, record.span());
  // Interpolates from the even row to the odd row. If the even row is the lower one, the odd row's share is one minus
  // the lower row's; `share` holds its negative (Places::down), so the difference is negated too. Same bits.
  const auto down = [&](V even, V odd, V share) {  // both negative
    return add(_mm256_mulhrs_epi16(_mm256_sign_epi16(_mm256_sub_epi16(odd, even), share), share), add(base, even));
  };
  return {down(_mm256_maddubs_epi16(_mm256_unpacklo_epi8(s.even.left, s.even.right), at.across.upper),
               _mm256_maddubs_epi16(_mm256_unpacklo_epi8(s.odd.left, s.odd.right), at.across.upper), at.down.upper),
          down(_mm256_maddubs_epi16(_mm256_unpackhi_epi8(s.even.left, s.even.right), at.across.lower),
               _mm256_maddubs_epi16(_mm256_unpackhi_epi8(s.odd.left, s.odd.right), at.across.lower), at.down.lower)};
}

/// Looks up bytes in a table of kLength bytes; every index is below kLength.
template <std::size_t kLength>
inline V look_up(const std::uint8_t* of, V index) {
  if constexpr (kLength == 16) {
    return _mm256_shuffle_epi8(row(of), index);
  } else {
    constexpr std::size_t kHalf = kLength / 2;
    // Moves the bit that selects the half to the top of its byte.
    const V upper = _mm256_slli_epi16(index, kLength == 64 ? 2 : 3);
    return _mm256_blendv_epi8(look_up<kHalf>(of, index), look_up<kHalf>(of + kHalf, index), upper);
  }
}

/// The curve's values, see curve_at.
template <int kBits, std::size_t kPieces>
inline Rows on_curve(Rows at, const Pieces<kPieces>& curve) {
  const V piece = _mm256_packus_epi16(_mm256_srli_epi16(at.upper, kBits), _mm256_srli_epi16(at.lower, kBits));
  const auto bytes = [&](std::size_t k) { return look_up<kPieces>(curve.bytes[k].data(), piece); };
  const V knot_low = bytes(0), knot_high = bytes(1), rise_low = bytes(2), rise_high = bytes(3);
  const auto value = [&](V knot, V rise, V of) {
    return add(knot, _mm256_mulhrs_epi16(rise, _mm256_slli_epi16(of, 15 - kBits)));
  };
  return {value(_mm256_unpacklo_epi8(knot_low, knot_high), _mm256_unpacklo_epi8(rise_low, rise_high), at.upper),
          value(_mm256_unpackhi_epi8(knot_low, knot_high), _mm256_unpackhi_epi8(rise_low, rise_high), at.lower)};
}

inline Rows negated(Rows rows, V base) {
  return {_mm256_sub_epi16(base, rows.upper), _mm256_sub_epi16(base, rows.lower)};
}

struct Avx2 {
  /// By component and half. Passed by reference and modified in place: GCC copies Rows in halves of registers, and a
  /// load of a whole register then stalls until both halves are stored.
  template <int N>
  using Light = std::array<std::array<Rows, 2>, N>;

  /// Applies the head's curves and gains to the interpolated samples of a record, of the tile's halves [kBegin, kEnd).
  template <int N, std::size_t kBegin, std::size_t kEnd>
  [[gnu::always_inline]] static inline void tone(const BlendJob& job, std::size_t r, Light<N>& negative_light) {
    const HeadIndex head = job.grid->records[r].head();
    if (job.curves) {
      for (std::size_t c = 0; c < N; ++c) {
        const Pieces<32>& curve = job.curve[head][job.component[c].tone];
        const V base = all(job.component[c].black);
        for (std::size_t half = kBegin; half < kEnd; ++half) {
          Rows& rows = negative_light[c][half];
          rows = negated(on_curve<10>(negated(rows, base), curve), base);
        }
      }
    }
    if (!job.gains) return;
    const bool alone = job.grid->gains.empty();
    Bilinear vignetting{};
    if (!alone) vignetting.set(out_of_sight(kConstants), job.grid->gains[r].data());
    if (kBegin == 1) vignetting.half();
    for (std::size_t half = kBegin; half < kEnd; ++half) {
      const Rows gains = vignetting.half();
      for (std::size_t c = 0; c < N; ++c) {
        const V of_head = all(job.gain(head, c));
        const V upper = alone ? of_head : _mm256_mulhrs_epi16(gains.upper, of_head);
        const V lower = alone ? of_head : _mm256_mulhrs_epi16(gains.lower, of_head);
        Rows& rows = negative_light[c][half];
        rows = {_mm256_mulhrs_epi16(rows.upper, upper), _mm256_mulhrs_epi16(rows.lower, lower)};
      }
    }
  }

  /// Adds the correction of the head's low frequencies.
  template <int N>
  [[gnu::always_inline]] static inline void correct(const BlendJob& job, HeadIndex head, Light<N>& negative_light) {
    if (!job.low_band->corrects(head)) return;
    const V unit = all(LowBand::kUnit);
    const V most = all(kMaxSample);
    const V least = all(-kMaxSample);
    const auto corrected = [&](V light, V by) {
      const V sum = _mm256_adds_epi16(light, _mm256_mulhrs_epi16(by, unit));
      return _mm256_max_epi16(_mm256_min_epi16(sum, most), least);
    };
    for (std::size_t c = 0; c < N; ++c) {
      Bilinear bilinear;
      bilinear.set(out_of_sight(kConstants), job.low_band->coefficients(head, c));
      for (Rows& rows : negative_light[c]) {
        const Rows by = bilinear.half();
        rows = {corrected(rows.upper, by.upper), corrected(rows.lower, by.lower)};
      }
    }
  }

  /// The light that a record contributes to the tile's halves [kBegin, kEnd), negative.
  template <int N, std::size_t kBegin, std::size_t kEnd>
  [[gnu::always_inline]] static inline void negative_light_of(const BlendJob& job, std::size_t r,
                                                              Light<N>& negative_light) {
    const PatchRecord& record = job.grid->records[r];
    Coordinates coordinates(out_of_sight(kConstants), *job.grid, record);
    if constexpr (N == 3) {
      if (Triples::can_read(job.plane(record))) {
        const Triples triples(job, job.plane(record), record);
        if (kBegin == 1) coordinates.positions(0);
        for (std::size_t half = kBegin; half < kEnd; ++half) {
          const Positions at = coordinates.positions(half);
          const RowsOfThree upper = triples.mix(at.x.upper, at.y.upper), lower = triples.mix(at.x.lower, at.y.lower);
          for (std::size_t c = 0; c < 3; ++c) negative_light[c][half] = {upper.of[c], lower.of[c]};
        }
        if (job.curves || job.gains) tone<N, kBegin, kEnd>(job, r, negative_light);
        return;
      }
    }
    alignas(32) std::array<Staged, N> staged;
    std::array<Patch, N> patch;
    find_patch<N>(job.plane(record), record, staged, patch);
    if (kBegin == 1) coordinates.half(out_of_sight(kConstants), 0);
#pragma GCC unroll 2  // keeps the state that half 0 leaves for half 1 in registers
    for (std::size_t half = kBegin; half < kEnd; ++half) {
      const Constants& k = out_of_sight(kConstants);  // per half: common values would be spilled to the stack
      const Places at = coordinates.half(k, half);
      for (std::size_t c = 0; c < N; ++c) {
        negative_light[c][half] = mix(k, patch[c], at, record, half, all(job.component[c].black));
      }
    }
    if (job.curves || job.gains) tone<N, kBegin, kEnd>(job, r, negative_light);
  }

  static inline Rows level_of(const BlendJob& job, std::size_t c, Rows light, bool negative) {
    const JobComponent& component = job.component[c];
    const V zero = _mm256_setzero_si256();
    if (component.output_curve) {
      if (negative) light = negated(light, zero);
      const Rows shown = on_curve<9>({_mm256_max_epi16(light.upper, zero), _mm256_max_epi16(light.lower, zero)},
                                     job.output[component.tone]);
      const V rounding = load(&out_of_sight(kConstants).half_level);
      return {_mm256_srai_epi16(add(shown.upper, rounding), kSampleBits),
              _mm256_srai_epi16(add(shown.lower, rounding), kSampleBits)};
    }
    const V scale = all(negative ? component.negative_scale : component.scale);
    const V black = all(component.black_level);
    return {add(_mm256_mulhrs_epi16(light.upper, scale), black), add(_mm256_mulhrs_epi16(light.lower, scale), black)};
  }

  template <int N>
  [[gnu::always_inline]] static inline void finish(const BlendJob& job, const Light<N>& light, bool negative,
                                                   std::uint8_t* out) {
    for (std::size_t c = 0; c < N; ++c) {
      for (std::size_t half = 0; half < 2; ++half) {
        const Rows level = level_of(job, c, light[c][half], negative);
        const V bytes = _mm256_packus_epi16(level.upper, level.lower);  // by quarters
        _mm256_store_si256(reinterpret_cast<V*>(out + c * kStrip + 32 * half),
                           _mm256_permutevar8x32_epi32(bytes, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7)));
      }
    }
  }

  /// For 16-bit raymaps: light is stored as it is.
  template <int N>
  [[gnu::always_inline]] static inline void finish(const BlendJob&, const Light<N>& light, bool negative,
                                                   std::int16_t* out) {
    for (std::size_t c = 0; c < N; ++c) {
      for (std::size_t half = 0; half < 2; ++half) {
        const Rows& of = light[c][half];
        const auto positive = [&](V v) { return negative ? _mm256_sub_epi16(_mm256_setzero_si256(), v) : v; };
        list_half({positive(of.upper), positive(of.lower)}, half, out + c * kStrip);
      }
    }
  }

  template <int N, class Number>
  static inline void tile(const BlendJob& job, const Tile& tile, std::size_t records, Number* out) {
    Light<N> negative_light;
    const Sharing how = tile.how();
    if (records != 0 && how == Sharing::kAlone) {
      next_light<Avx2, N>(job, tile.record, negative_light);
      return finish<N>(job, negative_light, true, out);
    }
    Light<N> light;
    for (auto& of : light) of.fill({_mm256_setzero_si256(), _mm256_setzero_si256()});
    std::array<Rows, 2> rest;
    rest.fill({all(-32768), all(-32768)});
    const std::int16_t* weights = job.grid->weights.data() + tile.weights();
    for (std::size_t r = tile.record, end = r + records; r < end;) {
      r += next_light<Avx2, N>(job, r, negative_light);
      std::array<Rows, 2> weight = rest;
      if (r < end || how == Sharing::kOpen) {
        if (how == Sharing::kBilinear) {
          Bilinear bilinear;
          bilinear.set(out_of_sight(kConstants), weights);
          weight = {bilinear.half(), bilinear.half()};
          weights += 4;
        } else {
          weight = {listed_half(weights, 0), listed_half(weights, 1)};
          weights += kTilePixels;
        }
        for (std::size_t half = 0; half < 2; ++half) {
          rest[half] = {_mm256_sub_epi16(rest[half].upper, weight[half].upper),
                        _mm256_sub_epi16(rest[half].lower, weight[half].lower)};
        }
      }
      for (std::size_t c = 0; c < N; ++c) {
        for (std::size_t half = 0; half < 2; ++half) {
          const Rows& of = negative_light[c][half];
          light[c][half].upper = add(light[c][half].upper, _mm256_mulhrs_epi16(of.upper, weight[half].upper));
          light[c][half].lower = add(light[c][half].lower, _mm256_mulhrs_epi16(of.lower, weight[half].lower));
        }
      }
    }
    finish<N>(job, light, false, out);
  }

  template <int N>
  static void samples(const BlendJob& job, const GridTable& grid, const PatchRecord& record,
                      std::array<TileValues, N>& samples) {
    const Constants& k = out_of_sight(kConstants);
    Coordinates coordinates(k, grid, record);
    alignas(32) std::array<Staged, N> staged;
    std::array<Patch, N> patch;
    find_patch<N>(job.plane(record), record, staged, patch);
    const V zero = _mm256_setzero_si256();
    for (std::size_t half = 0; half < 2; ++half) {
      const Places at = coordinates.half(k, half);
      for (std::size_t c = 0; c < N; ++c) {
        if (!record.has(half)) {
          std::fill_n(samples[c].begin() + static_cast<std::ptrdiff_t>(half * kTilePixels / 2), kTilePixels / 2,
                      std::int16_t{0});
          continue;
        }
        list_half(negated(mix(k, patch[c], at, record, half, zero), zero), half, samples[c].data());
      }
    }
  }

  /// Bypasses the caches if `to` is aligned, because the stores then fill whole cache lines.
  static inline void put(std::uint8_t* to, V bytes) {
    if ((reinterpret_cast<std::uintptr_t>(to) & 31) == 0) {
      _mm256_stream_si256(reinterpret_cast<V*>(to), bytes);
    } else {
      _mm256_storeu_si256(reinterpret_cast<V*>(to), bytes);
    }
  }
  static void put(std::uint8_t* to, const std::uint8_t* from, std::size_t bytes) {
    for (; bytes >= 32; bytes -= 32, to += 32, from += 32) put(to, load(from));
    std::memcpy(to, from, bytes);
  }

  /// Four rows of four adjacent tiles of a strip.
  static inline void rows_of(const std::uint8_t* tiles, V rows[4]) {
    const V a = load(tiles), b = load(tiles + kTilePixels);
    const V c = load(tiles + 2 * kTilePixels), d = load(tiles + 3 * kTilePixels);
    const V ab_even = _mm256_unpacklo_epi64(a, b), ab_odd = _mm256_unpackhi_epi64(a, b);
    const V cd_even = _mm256_unpacklo_epi64(c, d), cd_odd = _mm256_unpackhi_epi64(c, d);
    rows[0] = _mm256_permute2x128_si256(ab_even, cd_even, 0x20);
    rows[1] = _mm256_permute2x128_si256(ab_odd, cd_odd, 0x20);
    rows[2] = _mm256_permute2x128_si256(ab_even, cd_even, 0x31);
    rows[3] = _mm256_permute2x128_si256(ab_odd, cd_odd, 0x31);
  }

  template <int N>
  static bool emit(const BlendJob& job, int x, int y, const std::uint8_t* strip, const RowEnds&) {
    const bool triples = N == 3 && interleaved(job);
    const bool pairs = N == 2 && paired(job);
    if (!triples && !pairs && job.out[0].pixel_stride != 1) return false;
    std::array<std::uint8_t*, N> to;
    std::array<std::ptrdiff_t, N> stride;
    for (std::size_t c = 0; c < N; ++c) {
      stride[c] = job.out[c].row_stride;
      to[c] = job.out[c].data + y * stride[c] + std::ptrdiff_t{x} * job.out[c].pixel_stride;
    }
    for (std::size_t half = 0; half < 2; ++half) {
      V rows[N][2][4];
      for (std::size_t c = 0; c < N; ++c) {
        for (std::size_t side = 0; side < 2; ++side) {
          rows_of(strip + c * kStrip + 4 * side * kTilePixels + half * kTilePixels / 2, rows[c][side]);
        }
      }
#pragma GCC unroll 4
      for (std::size_t j = 0; j < kTile / 2; ++j) {
#pragma GCC unroll 2
        for (std::size_t side = 0; side < 2; ++side) {
          if (triples) {
            const V of[3] = {rows[0][side][j], rows[N > 1 ? 1 : 0][side][j], rows[N - 1][side][j]};
            V thirds[3];
            interleave(of, thirds);
            for (std::size_t k = 0; k < 3; ++k) put(to[0] + 96 * side + 32 * k, thirds[k]);
          } else if (pairs) {
            const V u = rows[0][side][j], v = rows[N - 1][side][j];
            const V low = _mm256_unpacklo_epi8(u, v), high = _mm256_unpackhi_epi8(u, v);
            put(to[0] + 64 * side, _mm256_permute2x128_si256(low, high, 0x20));
            put(to[0] + 64 * side + 32, _mm256_permute2x128_si256(low, high, 0x31));
          } else {
            for (std::size_t c = 0; c < N; ++c) put(to[c] + 32 * side, rows[c][side][j]);
          }
        }
        for (std::size_t c = 0; c < N; ++c) to[c] += stride[c];
      }
    }
    return true;
  }
};

}  // namespace

void blend_avx2(const BlendJob& job) {
  blend_by<Avx2>(job);
  _mm_sfence();
}

}  // namespace nodal::blend

NODAL_TARGET_END
