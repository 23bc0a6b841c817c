// The blend for AVX-512 with VBMI. A patch of 16x16 samples fills four registers; the four samples that each of a
// tile's 64 pixels interpolates are picked from two registers at a time by their index. All code for a tile is
// force-inlined: a function call passes registers through memory, which costs a sixth of the time.
#include <immintrin.h>

#include <algorithm>
#include <array>

#include "stitch/blend/blend_job.h"
#include "stitch/blend/low_band.h"
#include "stitch/blend/target.h"

NODAL_TARGET_BEGIN("avx2,avx512f,avx512bw,avx512dq,avx512vl,avx512vbmi")

#include "stitch/blend/constants_avx512.h"
#include "stitch/blend/lines_avx512.h"
#include "stitch/blend/patch_avx512.h"
#include "stitch/blend/places_avx512.h"
#include "stitch/blend/tile_driver.h"

namespace nodal::blend {
namespace {

/// The bytes of a patch at 64 indices; an index with its top bit set is in rows 8 .. 15.
[[gnu::always_inline]] inline V pick(const Patch& patch, V index) {
  return _mm512_mask_blend_epi8(_mm512_movepi8_mask(index),
                                _mm512_permutex2var_epi8(patch.rows[0], index, patch.rows[1]),
                                _mm512_permutex2var_epi8(patch.rows[2], index, patch.rows[3]));
}

/// base - sample for half a tile; base is 128 times black.
[[gnu::always_inline]] inline V mix(const Constants& k, const Patch& patch, const Places& at, V base) {
  const V below = _mm512_add_epi8(at.index, load(k.row));
  const V top = _mm512_maddubs_epi16(pick(patch, at.index), at.across);  // both negative
  const V bottom = _mm512_maddubs_epi16(pick(patch, below), at.across);
  return _mm512_add_epi16(_mm512_mulhrs_epi16(_mm512_sub_epi16(bottom, top), at.down), _mm512_add_epi16(base, top));
}

/// black - curve(sample) for -sample.
[[gnu::always_inline]] inline V curved(V negative, const Pieces<32>& curve) {
  const V sample = _mm512_sub_epi16(_mm512_setzero_si512(), negative);
  const V piece = _mm512_srli_epi16(sample, 10);
  const V fraction = _mm512_slli_epi16(sample, 5);
  const V knot = _mm512_permutexvar_epi16(piece, _mm512_load_si512(curve.negative_knot.data()));
  const V rise = _mm512_permutexvar_epi16(piece, _mm512_load_si512(curve.rise.data()));
  return _mm512_sub_epi16(knot, _mm512_mulhrs_epi16(rise, fraction));
}

[[gnu::always_inline]] inline V developed(const Constants& k, V light, const Pieces<64>& curve) {
  const V at = _mm512_max_epi16(light, _mm512_setzero_si512());
  const V piece = _mm512_srli_epi16(at, 9);
  const V fraction = _mm512_slli_epi16(at, 6);
  const auto look_up = [&](const std::array<std::int16_t, 64>& of) {
    return _mm512_permutex2var_epi16(_mm512_load_si512(of.data()), piece, _mm512_load_si512(of.data() + 32));
  };
  const V shown = _mm512_add_epi16(look_up(curve.knot), _mm512_mulhrs_epi16(look_up(curve.rise), fraction));
  return _mm512_srai_epi16(_mm512_add_epi16(shown, load(k.half_level)), kSampleBits);
}

/// Indices for bytes 64 k .. 64 k + 63 of R G B R G B ..: into R's register and, for G, into the register after it.
constexpr Picks triple_bytes() {
  Picks picks;
  for (std::size_t m = 0; m < 192; ++m)
    picks.of[m / 64][m % 64] = static_cast<std::uint8_t>(m / 3 + (m % 3 == 1 ? 64 : 0));
  return picks;
}
constexpr Picks kTripleBytes = triple_bytes();
/// Which of those bytes are B's, as masks.
constexpr std::array<__mmask64, 3> kThirds{0x4924924924924924, 0x2492492492492492, 0x9249249249249249};

/// The same for U V U V ..: indices into U's register and, for V, into the register after it.
constexpr Picks pair_bytes() {
  Picks picks;
  for (std::size_t m = 0; m < 128; ++m) picks.of[m / 64][m % 64] = static_cast<std::uint8_t>(m / 2 + m % 2 * 64);
  return picks;
}
constexpr Picks kPairBytes = pair_bytes();

struct Avx512 {
  /// The light that record r, or the pair that begins with it, contributes to all components, negative. Returns how
  /// many records these are.
  template <int N>
  [[gnu::always_inline]] static inline std::size_t next_light(const BlendJob& job, std::size_t r, const Constants& k,
                                                              std::array<Rows, N>& negative_light) {
    const PatchRecord* record = &job.grid->records[r];
    const std::size_t count = record->paired() ? 2 : 1;
    prefetch<N>(job, r);
    by_layout<N>(
        job.plane(*record).layout, [&](auto layout) __attribute__((always_inline)) {
          mix_patches<N, decltype(layout)::value>(job, record, k, negative_light);
        });
    if (job.curves) {
      for (std::size_t c = 0; c < N; ++c) {
        const Pieces<32>& curve = job.curve[record->head()][job.component[c].tone];
        negative_light[c] = {curved(negative_light[c].upper, curve), curved(negative_light[c].lower, curve)};
      }
    }
    if (job.gains) apply_gains<N>(job, r, count, k, negative_light);
    if (job.low_band != nullptr) correct<N>(job, record->head(), k, negative_light);
    return count;
  }

  /// Black less the samples of a record, or of the pair that begins with it; where there are curves, minus the samples.
  template <int N, SampleLayout kLayout>
  [[gnu::always_inline]] static inline void mix_patches(const BlendJob& job, const PatchRecord* record,
                                                        const Constants& k, std::array<Rows, N>& negative_light) {
    const PatchPlane& plane = job.plane(*record);
    const auto base = [&](std::size_t c) {  // a curve includes it
      return job.curves ? _mm512_setzero_si512() : all(job.component[c].black);
    };
    Coordinates at = coordinates_of(k, *job.grid, *record);
    std::array<Patch, N> patch;
    load_patch<N, kLayout>(plane, *record, patch);
    const Places upper = places(k, at.x.upper, at.y.upper);
    for (std::size_t c = 0; c < N; ++c) negative_light[c].upper = mix(k, patch[c], upper, base(c));
    if (record->paired()) {
      prefetch<N>(job, static_cast<std::size_t>(record + 1 - job.grid->records.data()));
      load_patch<N, kLayout>(plane, record[1], patch);
      if (!record->listed()) {
        at.x.lower = _mm512_add_epi16(at.x.lower, _mm512_set1_epi16(moved(0, record[1].left - record[0].left)));
        at.y.lower = _mm512_add_epi16(at.y.lower, _mm512_set1_epi16(moved(0, record[1].top - record[0].top)));
      }
    }
    const Places lower = places(k, at.x.lower, at.y.lower);
    for (std::size_t c = 0; c < N; ++c) negative_light[c].lower = mix(k, patch[c], lower, base(c));
  }

  /// `records`: 2 for a pair, of which each has gains of its own.
  template <int N>
  [[gnu::always_inline]] static inline void apply_gains(const BlendJob& job, std::size_t r, std::size_t records,
                                                        const Constants& k, std::array<Rows, N>& negative_light) {
    const HeadIndex head = job.grid->records[r].head();
    const bool alone = job.grid->gains.empty();
    Rows vignetting = alone ? Rows{} : bilinear(k, job.grid->gains[r].data());
    if (!alone && records == 2) vignetting.lower = bilinear(k, job.grid->gains[r + 1].data()).lower;
    for (std::size_t c = 0; c < N; ++c) {
      const V of_head = all(job.gain(head, c));
      const V upper = alone ? of_head : _mm512_mulhrs_epi16(vignetting.upper, of_head);
      const V lower = alone ? of_head : _mm512_mulhrs_epi16(vignetting.lower, of_head);
      negative_light[c] = {_mm512_mulhrs_epi16(negative_light[c].upper, upper),
                           _mm512_mulhrs_epi16(negative_light[c].lower, lower)};
    }
  }

  /// Adds the correction of the head's low frequencies.
  template <int N>
  [[gnu::always_inline]] static inline void correct(const BlendJob& job, HeadIndex head, const Constants& k,
                                                    std::array<Rows, N>& negative_light) {
    if (!job.low_band->corrects(head)) return;
    const V unit = all(LowBand::kUnit);
    const V most = all(kMaxSample);
    const V least = all(-kMaxSample);
    const auto corrected = [&](V light, V by) {
      const V sum = _mm512_adds_epi16(light, _mm512_mulhrs_epi16(by, unit));
      return _mm512_max_epi16(_mm512_min_epi16(sum, most), least);
    };
    for (std::size_t c = 0; c < N; ++c) {
      const Rows by = bilinear(k, job.low_band->coefficients(head, c));
      Rows& rows = negative_light[c];
      rows = {corrected(rows.upper, by.upper), corrected(rows.lower, by.lower)};
    }
  }

  template <int N>
  [[gnu::always_inline]] static inline void finish(const BlendJob& job, const std::array<Rows, N>& light, bool negative,
                                                   std::uint8_t* out) {
    const Constants& k = out_of_sight(kConstants);
    for (std::size_t c = 0; c < N; ++c) {
      const JobComponent& component = job.component[c];
      V upper = light[c].upper;
      V lower = light[c].lower;
      if (component.output_curve) {
        if (negative) {
          upper = _mm512_sub_epi16(_mm512_setzero_si512(), upper);
          lower = _mm512_sub_epi16(_mm512_setzero_si512(), lower);
        }
        upper = developed(k, upper, job.output[component.tone]);
        lower = developed(k, lower, job.output[component.tone]);
      } else {
        const V scale = all(negative ? component.negative_scale : component.scale);
        const V black = all(component.black_level);
        upper = _mm512_add_epi16(_mm512_mulhrs_epi16(upper, scale), black);
        lower = _mm512_add_epi16(_mm512_mulhrs_epi16(lower, scale), black);
      }
      const V bytes = _mm512_packus_epi16(upper, lower);  // rows 0 4 1 5 2 6 3 7
      _mm512_store_si512(out + c * kStrip, _mm512_permutexvar_epi64(load(k.order), bytes));
    }
  }

  /// For 16-bit raymaps: light is stored as it is.
  template <int N>
  [[gnu::always_inline]] static inline void finish(const BlendJob&, const std::array<Rows, N>& light, bool negative,
                                                   std::int16_t* out) {
    const V zero = _mm512_setzero_si512();
    for (std::size_t c = 0; c < N; ++c) {
      _mm512_store_si512(out + c * kStrip, negative ? _mm512_sub_epi16(zero, light[c].upper) : light[c].upper);
      _mm512_store_si512(out + c * kStrip + 32, negative ? _mm512_sub_epi16(zero, light[c].lower) : light[c].lower);
    }
  }

  template <int N, class Number>
  [[gnu::always_inline]] static inline void tile(const BlendJob& job, const Tile& tile, std::size_t records,
                                                 Number* out) {
    const Constants& k = out_of_sight(kConstants);
    std::array<Rows, N> negative_light;
    const Sharing how = tile.how();
    if (records != 0 && how == Sharing::kAlone) {
      next_light<N>(job, tile.record, k, negative_light);
      return finish<N>(job, negative_light, true, out);
    }
    std::array<Rows, N> light{};
    const std::int16_t* weights = job.grid->weights.data() + tile.weights();
    Rows rest{_mm512_set1_epi16(-32768), _mm512_set1_epi16(-32768)};
    for (std::size_t r = tile.record, end = r + records; r < end;) {
      r += next_light<N>(job, r, k, negative_light);
      Rows weight = rest;
      if (r < end || how == Sharing::kOpen) {
        if (how == Sharing::kBilinear) {
          weight = bilinear(k, weights);
          weights += 4;
        } else {
          weight = {_mm512_loadu_si512(weights), _mm512_loadu_si512(weights + 32)};
          weights += kTilePixels;
        }
        rest = {_mm512_sub_epi16(rest.upper, weight.upper), _mm512_sub_epi16(rest.lower, weight.lower)};
      }
      for (std::size_t c = 0; c < N; ++c) {
        light[c].upper = _mm512_add_epi16(light[c].upper, _mm512_mulhrs_epi16(negative_light[c].upper, weight.upper));
        light[c].lower = _mm512_add_epi16(light[c].lower, _mm512_mulhrs_epi16(negative_light[c].lower, weight.lower));
      }
    }
    finish<N>(job, light, false, out);
  }

  template <int N>
  static void samples(const BlendJob& job, const GridTable& grid, const PatchRecord& record,
                      std::array<TileValues, N>& samples) {
    const PatchPlane& plane = job.plane(record);
    std::array<Patch, N> patch;
    by_layout<N>(plane.layout, [&](auto layout) { load_patch<N, decltype(layout)::value>(plane, record, patch); });
    const Constants& k = out_of_sight(kConstants);
    const Coordinates at = coordinates_of(k, grid, record);
    const Places upper = places(k, at.x.upper, at.y.upper), lower = places(k, at.x.lower, at.y.lower);
    const V zero = _mm512_setzero_si512();
    for (std::size_t c = 0; c < N; ++c) {
      _mm512_storeu_si512(samples[c].data(), _mm512_sub_epi16(zero, mix(k, patch[c], upper, zero)));
      _mm512_storeu_si512(samples[c].data() + 32, _mm512_sub_epi16(zero, mix(k, patch[c], lower, zero)));
    }
  }

  /// The eight rows of a strip. A row is eight bytes of every tile, so this is an 8x8 transposition of 64-bit numbers.
  [[gnu::always_inline]] static inline void rows_of(const std::uint8_t* strip, V rows[8]) {
    V pairs[8];
    for (std::size_t k = 0; k < 8; k += 2) {
      const V left = _mm512_load_si512(strip + 64 * k);
      const V right = _mm512_load_si512(strip + 64 * (k + 1));
      pairs[k] = _mm512_unpacklo_epi64(left, right);      // rows 0 2 4 6
      pairs[k + 1] = _mm512_unpackhi_epi64(left, right);  // rows 1 3 5 7
    }
    for (std::size_t odd = 0; odd < 2; ++odd) {
      const V a = _mm512_shuffle_i64x2(pairs[odd], pairs[2 + odd], 0x44);
      const V b = _mm512_shuffle_i64x2(pairs[4 + odd], pairs[6 + odd], 0x44);
      const V d = _mm512_shuffle_i64x2(pairs[odd], pairs[2 + odd], 0xee);
      const V e = _mm512_shuffle_i64x2(pairs[4 + odd], pairs[6 + odd], 0xee);
      rows[odd] = _mm512_shuffle_i64x2(a, b, 0x88);
      rows[2 + odd] = _mm512_shuffle_i64x2(a, b, 0xdd);
      rows[4 + odd] = _mm512_shuffle_i64x2(d, e, 0x88);
      rows[6 + odd] = _mm512_shuffle_i64x2(d, e, 0xdd);
    }
  }

  static void put(std::uint8_t* to, const std::uint8_t* from, std::size_t bytes) {
    for (; bytes >= 64; bytes -= 64, to += 64, from += 64) put_bytes(to, _mm512_loadu_si512(from));
    std::memcpy(to, from, bytes);
  }

  template <int N>
  static bool emit(const BlendJob& job, int x, int y, const std::uint8_t* strip, const RowEnds& ends) {
    const int step = job.out[0].pixel_stride;
    const bool triples = N == 3 && interleaved(job);
    const bool pairs = N == 2 && paired(job);
    if (!triples && !pairs && step != 1) return false;
    V rows[N][8];
    for (std::size_t c = 0; c < N; ++c) rows_of(strip + c * kStrip, rows[c]);
    for (std::size_t j = 0; j < kTile; ++j) {
      const auto row = static_cast<std::ptrdiff_t>(y) + static_cast<std::ptrdiff_t>(j);
      if (triples) {
        V bytes[3];
        for (std::size_t k = 0; k < 3; ++k) {
          const V from = load(kTripleBytes.of[k]);
          const V two = _mm512_permutex2var_epi8(rows[0][j], from, rows[N > 1 ? 1 : 0][j]);
          bytes[k] = _mm512_mask_permutexvar_epi8(two, kThirds[k], from, rows[N - 1][j]);
        }
        put_row(job.out[0].data + row * job.out[0].row_stride + std::ptrdiff_t{x} * 3, bytes, ends, j);
      } else if (pairs) {
        V bytes[2];
        for (std::size_t k = 0; k < 2; ++k)
          bytes[k] = _mm512_permutex2var_epi8(rows[0][j], load(kPairBytes.of[k]), rows[N - 1][j]);
        put_row(job.out[0].data + row * job.out[0].row_stride + std::ptrdiff_t{x} * 2, bytes, ends, j);
      } else {
        for (std::size_t c = 0; c < N; ++c) {
          const V bytes[1] = {rows[c][j]};
          put_row(job.out[c].data + row * job.out[c].row_stride + x, bytes, ends, c * kTile + j);
        }
      }
    }
    return true;
  }
};

}  // namespace

void blend_avx512(const BlendJob& job) {
  blend_by<Avx512>(job);
  _mm_sfence();
}

}  // namespace nodal::blend

NODAL_TARGET_END
