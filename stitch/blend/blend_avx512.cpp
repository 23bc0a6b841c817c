// The blend by AVX-512 with VBMI: a patch of 16x16 samples fills four registers, and the four samples that each of a
// tile's 64 pixels mixes are picked out of them by their place, two registers at a time.
#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <type_traits>

#include "stitch/blend/blend_job.h"
#include "stitch/blend/target.h"

NODAL_TARGET_BEGIN("avx2,avx512f,avx512bw,avx512dq,avx512vl,avx512vbmi")

#include "stitch/blend/tile_driver.h"

namespace nodal::blend {
namespace {

using V = __m512i;

/// Two registers of 32 numbers: the even rows of a tile, and its odd rows. A 128-bit lane is a row.
struct Rows {
  V even;
  V odd;
};

inline V all(int value) { return _mm512_set1_epi16(static_cast<short>(value)); }

/// i, ii and j, jj, 2j + 1 of the even rows.
struct Steps {
  __m256i i, ii;
  V j, jj, next;
};
inline V lanes(short a, short b, short c, short d) {
  V v = _mm512_castsi128_si512(_mm_set1_epi16(a));
  v = _mm512_inserti32x4(v, _mm_set1_epi16(b), 1);
  v = _mm512_inserti32x4(v, _mm_set1_epi16(c), 2);
  return _mm512_inserti32x4(v, _mm_set1_epi16(d), 3);
}
inline Steps steps() {
  const __m128i i = _mm_setr_epi16(0, 1, 2, 3, 4, 5, 6, 7);
  return {_mm256_broadcastsi128_si256(i), _mm256_broadcastsi128_si256(_mm_mullo_epi16(i, i)), lanes(0, 2, 4, 6),
          lanes(0, 4, 16, 36), lanes(1, 5, 9, 13)};
}

/// Where a tile's pixels lie in a patch, ready for use.
struct Places {
  V index;      ///< bytes, by pixel: row * 16 + column of the upper left sample
  Rows across;  ///< pairs of bytes: the shares of the left and the right sample, of -128: one is then a byte
  Rows down;    ///< the lower row's share, of 2^15
};

inline Places places(Rows x, Rows y) {
  const V row = all(0xf0), low = all(127), whole = all(128), fraction = all(0x7ff8);
  const auto index = [&](V x_, V y_) {
    return _mm512_ternarylogic_epi32(_mm512_srli_epi16(y_, 8), row, _mm512_srli_epi16(x_, 12), 0xea);  // a & b | c
  };
  const auto across = [&](V x_) {
    const V f = _mm512_and_si512(_mm512_srli_epi16(x_, 5), low);
    return _mm512_sub_epi16(_mm512_add_epi16(f, whole), _mm512_slli_epi16(f, 8));
  };
  return {_mm512_packus_epi16(index(x.even, y.even), index(x.odd, y.odd)),
          {across(x.even), across(x.odd)},
          {_mm512_and_si512(_mm512_slli_epi16(y.even, 3), fraction),
           _mm512_and_si512(_mm512_slli_epi16(y.odd, 3), fraction)}};
}

/// In all four lanes.
inline V lower_half(__m256i v) { return _mm512_broadcast_i32x4(_mm256_castsi256_si128(v)); }
inline V upper_half(__m256i v) {
  const V wide = _mm512_castsi256_si512(v);
  return _mm512_shuffle_i64x2(wide, wide, 0x55);
}

inline Places places_of(const GridTable& grid, const PatchRecord& record, const Steps& s) {
  if (record.listed()) {
    const std::uint16_t* list = grid.coordinates.data() + record.list() * 2 * kTilePixels;
    return places({_mm512_loadu_si512(list), _mm512_loadu_si512(list + 32)},
                  {_mm512_loadu_si512(list + 64), _mm512_loadu_si512(list + 96)});
  }
  const __m256i both = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(&record));  // x below, y above
  const auto term = [&](int k) {
    return _mm256_shuffle_epi8(both, _mm256_set1_epi16(static_cast<short>(2 * k | (2 * k + 1) << 8)));
  };
  const __m256i a = _mm256_add_epi16(_mm256_add_epi16(term(0), _mm256_mullo_epi16(term(1), s.i)),
                                     _mm256_mullo_epi16(term(4), s.ii));
  const __m256i b = _mm256_add_epi16(term(2), _mm256_mullo_epi16(term(3), s.i));
  const __m256i c = term(5);
  const auto rows = [&](V a_, V b_, V c_) -> Rows {
    const V even =
        _mm512_add_epi16(_mm512_add_epi16(a_, _mm512_mullo_epi16(b_, s.j)), _mm512_mullo_epi16(c_, s.jj));
    return {even, _mm512_add_epi16(even, _mm512_add_epi16(b_, _mm512_mullo_epi16(c_, s.next)))};
  };
  return places(rows(lower_half(a), lower_half(b), lower_half(c)), rows(upper_half(a), upper_half(b), upper_half(c)));
}

/// Four coefficients of 1, i, j, ij over a tile.
inline Rows bilinear(const std::int16_t* q, const Steps& s) {
  const V terms = _mm512_broadcastq_epi64(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(q)));
  const auto term = [&](int k) { return _mm512_shuffle_epi8(terms, all(2 * k | (2 * k + 1) << 8)); };
  const V i = _mm512_broadcast_i64x4(s.i);
  const V b = _mm512_add_epi16(term(2), _mm512_mullo_epi16(term(3), i));
  const V even = _mm512_add_epi16(_mm512_add_epi16(term(0), _mm512_mullo_epi16(term(1), i)),
                                  _mm512_mullo_epi16(b, s.j));
  return {even, _mm512_add_epi16(even, b)};
}

/// A patch of one component: rows 0 .. 3, 4 .. 7, and so on.
struct Patch {
  V rows[4];
};

/// Four rows of 16 bytes, `stride` apart.
inline V four_rows(const std::uint8_t* at, std::ptrdiff_t stride) {
  const auto row = [&](int k) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(at + k * stride)); };
  V v = _mm512_castsi128_si512(row(0));
  v = _mm512_mask_broadcast_i32x4(v, 0x00f0, row(1));
  v = _mm512_mask_broadcast_i32x4(v, 0x0f00, row(2));
  return _mm512_mask_broadcast_i32x4(v, 0xf000, row(3));
}

/// Two rows of 32 bytes.
inline V two_rows(const std::uint8_t* at, std::ptrdiff_t stride) {
  const V v = _mm512_castsi256_si512(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(at)));
  return _mm512_inserti64x4(v, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at + stride)), 1);
}

/// 0, step, 2 step, .. + first: byte k of component `first` in groups of `step`, over two registers.
struct Picks {
  alignas(64) std::array<std::array<std::uint8_t, 64>, 3> of{};
};
constexpr Picks pair_picks() {  // 16 of each of four rows of 32 bytes; by component's offset
  Picks picks;
  for (std::size_t k = 0; k < 64; ++k) {
    for (std::size_t c = 0; c < 2; ++c) picks.of[c][k] = static_cast<std::uint8_t>(2 * k + c);
  }
  return picks;
}
constexpr Picks quad_picks() {  // 16 of each of two rows of 64 bytes, of components c and c + 2
  Picks picks;
  for (std::size_t k = 0; k < 64; ++k) {
    for (std::size_t c = 0; c < 2; ++c) {
      picks.of[c][k] = static_cast<std::uint8_t>(k / 16 % 2 * 64 + k % 16 * 4 + c + k / 32 * 2);
    }
  }
  return picks;
}
constexpr Picks triple_picks() {  // 16 of each of two rows of 48 bytes in 64: components 0 and 1, then 2 twice
  Picks picks;
  for (std::size_t k = 0; k < 64; ++k) {
    const std::size_t from = k / 16 % 2 * 64 + k % 16 * 3;
    picks.of[0][k] = static_cast<std::uint8_t>(from + k / 32);
    picks.of[1][k] = static_cast<std::uint8_t>(from + 2);
  }
  return picks;
}
constexpr Picks kPairPicks = pair_picks();
constexpr Picks kQuadPicks = quad_picks();
constexpr Picks kTriplePicks = triple_picks();

inline V load(const std::array<std::uint8_t, 64>& bytes) { return _mm512_load_si512(bytes.data()); }

/// A patch in memory, one component after the other.
template <int N>
using Staged = std::array<std::uint8_t, N * kPatch * kPatch>;

/// By PlaneView, sample by sample.
[[gnu::noinline]] void stage(const PatchPlane& plane, const PatchRecord& record, std::size_t components,
                             std::uint8_t* staged) {
  std::fill_n(staged, components * kPatch * kPatch, std::uint8_t{0});
  for (std::size_t c = 0; c < components; ++c, staged += kPatch * kPatch) {
    const PlaneView& view = plane.views[c];
    for (int y = 0; y < std::min(kPatch, view.height - record.top); ++y) {
      const std::uint8_t* from = view.data + (record.top + y) * view.row_stride;
      for (int x = 0; x < std::min(kPatch, view.width - record.left); ++x) {
        staged[y * kPatch + x] = from[std::ptrdiff_t{record.left + x} * view.pixel_stride];
      }
    }
  }
}

/// Rows 4 k .. 4 k + 3 of the patches of all components, whose first row begins at from[c], or in groups at from[0].
template <int N, Lie kLie>
inline void load_rows(const PatchPlane& plane, const std::array<const std::uint8_t*, N>& from, std::ptrdiff_t stride,
                      std::size_t k, std::array<Patch, N>& patch) {
  const std::ptrdiff_t down = static_cast<std::ptrdiff_t>(4 * k) * stride;
  const auto row = [&](int y) { return _mm512_loadu_si512(from[0] + down + y * stride); };
  if constexpr (kLie == Lie::kPairs) {
    const V upper = two_rows(from[0] + down, stride);
    const V lower = two_rows(from[0] + down + 2 * stride, stride);
    for (std::size_t c = 0; c < N; ++c) {
      patch[c].rows[k] = _mm512_permutex2var_epi8(upper, load(kPairPicks.of[plane.offset[c] & 1]), lower);
    }
  } else if constexpr (kLie == Lie::kQuads) {
    const V picks = load(kQuadPicks.of[plane.offset[0] & 1]);
    const V upper = _mm512_permutex2var_epi8(row(0), picks, row(1));
    const V lower = _mm512_permutex2var_epi8(row(2), picks, row(3));
    patch[0].rows[k] = _mm512_shuffle_i64x2(upper, lower, 0x44);
    patch[1].rows[k] = _mm512_shuffle_i64x2(upper, lower, 0xee);
  } else if constexpr (kLie == Lie::kTriples) {
    const auto triples = [&](int y) { return _mm512_maskz_loadu_epi8(0x0000ffffffffffff, from[0] + down + y * stride); };
    const V rows[4] = {triples(0), triples(1), triples(2), triples(3)};
    const V both = load(kTriplePicks.of[0]);
    const V last = load(kTriplePicks.of[1]);
    const V upper = _mm512_permutex2var_epi8(rows[0], both, rows[1]);
    const V lower = _mm512_permutex2var_epi8(rows[2], both, rows[3]);
    patch[0].rows[k] = _mm512_shuffle_i64x2(upper, lower, 0x44);
    patch[1].rows[k] = _mm512_shuffle_i64x2(upper, lower, 0xee);
    patch[2].rows[k] = _mm512_shuffle_i64x2(_mm512_permutex2var_epi8(rows[0], last, rows[1]),
                                            _mm512_permutex2var_epi8(rows[2], last, rows[3]), 0x44);
  } else {
    for (std::size_t c = 0; c < N; ++c) patch[c].rows[k] = four_rows(from[c] + down, stride);
  }
}

template <int N, Lie kLie>
inline void load_patch(const PatchPlane& plane, const PatchRecord& record, std::array<Patch, N>& patch) {
  std::ptrdiff_t stride = plane.row_stride;
  std::array<const std::uint8_t*, N> from;
  Staged<kLie == Lie::kAnyhow ? N : 0> staged;
  if constexpr (kLie == Lie::kAnyhow) {
    stage(plane, record, N, staged.data());
    stride = kPatch;
    for (std::size_t c = 0; c < N; ++c) from[c] = staged.data() + c * kPatch * kPatch;
  } else {
    const std::ptrdiff_t at = record.top * stride + std::ptrdiff_t{record.left} * plane.group;
    for (std::size_t c = 0; c < (kLie == Lie::kPlanar ? N : 1); ++c) from[c] = plane.data[c] + at;
  }
  for (std::size_t k = 0; k < 3; ++k) load_rows<N, kLie>(plane, from, stride, k, patch);
  // A tile seldom needs the last four of a patch's rows.
  if (std::max(record.rows[0], record.rows[1]) >> 4 > 10) {
    load_rows<N, kLie>(plane, from, stride, 3, patch);
  } else {
    for (std::size_t c = 0; c < N; ++c) patch[c].rows[3] = patch[c].rows[2];
  }
}

/// use(std::integral_constant<Lie, how a plane's samples lie>): what follows is compiled for each, so that patches do not
/// leave their registers.
template <int N, class Use>
inline void by_lie(Lie lie, Use use) {
  if (lie == Lie::kPlanar) return use(std::integral_constant<Lie, Lie::kPlanar>());
  if constexpr (N < 3) {
    if (lie == Lie::kPairs) return use(std::integral_constant<Lie, Lie::kPairs>());
  }
  if constexpr (N == 2) {
    if (lie == Lie::kQuads) return use(std::integral_constant<Lie, Lie::kQuads>());
  }
  if constexpr (N == 3) {
    if (lie == Lie::kTriples) return use(std::integral_constant<Lie, Lie::kTriples>());
  }
  use(std::integral_constant<Lie, Lie::kAnyhow>());
}

/// The bytes of a patch at 64 places. Those with `lower` lie in its rows 8 .. 15.
inline V pick(const Patch& patch, V index, __mmask64 lower) {
  return _mm512_mask_blend_epi8(lower, _mm512_permutex2var_epi8(patch.rows[0], index, patch.rows[1]),
                                _mm512_permutex2var_epi8(patch.rows[2], index, patch.rows[3]));
}

/// base - sample, base 128 times black.
inline Rows mix(const Patch& patch, const Places& at, V base) {
  const V below = _mm512_add_epi8(at.index, _mm512_set1_epi8(16));
  const V one = _mm512_set1_epi8(1);
  const __mmask64 lower = _mm512_movepi8_mask(at.index);  // the next sample is in the same row
  const __mmask64 lower_below = _mm512_movepi8_mask(below);
  const V p00 = pick(patch, at.index, lower);
  const V p10 = pick(patch, _mm512_add_epi8(at.index, one), lower);
  const V p01 = pick(patch, below, lower_below);
  const V p11 = pick(patch, _mm512_add_epi8(below, one), lower_below);
  const auto down = [&](V top, V bottom, V share) {  // both negative
    return _mm512_add_epi16(_mm512_mulhrs_epi16(_mm512_sub_epi16(bottom, top), share), _mm512_add_epi16(base, top));
  };
  return {down(_mm512_maddubs_epi16(_mm512_unpacklo_epi8(p00, p10), at.across.even),
               _mm512_maddubs_epi16(_mm512_unpacklo_epi8(p01, p11), at.across.even), at.down.even),
          down(_mm512_maddubs_epi16(_mm512_unpackhi_epi8(p00, p10), at.across.odd),
               _mm512_maddubs_epi16(_mm512_unpackhi_epi8(p01, p11), at.across.odd), at.down.odd)};
}

/// base - curve(sample) for -sample.
inline V curved(V negative, const Pieces<32>& curve, V base) {
  const V sample = _mm512_sub_epi16(_mm512_setzero_si512(), negative);
  const V piece = _mm512_srli_epi16(sample, 10);
  const V fraction = _mm512_slli_epi16(_mm512_and_si512(sample, all(1023)), 5);
  const V knot = _mm512_permutexvar_epi16(piece, _mm512_load_si512(curve.knot.data()));
  const V rise = _mm512_permutexvar_epi16(piece, _mm512_load_si512(curve.rise.data()));
  return _mm512_sub_epi16(base, _mm512_add_epi16(knot, _mm512_mulhrs_epi16(rise, fraction)));
}

inline V developed(V light, const Pieces<64>& curve) {
  const V at = _mm512_max_epi16(light, _mm512_setzero_si512());
  const V piece = _mm512_srli_epi16(at, 9);
  const V fraction = _mm512_slli_epi16(_mm512_and_si512(at, all(511)), 6);
  const auto look_up = [&](const std::array<std::int16_t, 64>& of) {
    return _mm512_permutex2var_epi16(_mm512_load_si512(of.data()), piece, _mm512_load_si512(of.data() + 32));
  };
  const V shown = _mm512_add_epi16(look_up(curve.knot), _mm512_mulhrs_epi16(look_up(curve.rise), fraction));
  return _mm512_srai_epi16(_mm512_add_epi16(shown, all(64)), kSampleBits);
}

struct Avx512 {
  /// Light of all components by one record, negative.
  template <int N>
  static inline void dark_of(const BlendJob& job, std::size_t r, const Steps& s, std::array<Rows, N>& dark) {
    by_lie<N>(job.plane(job.grid->records[r]).lie, [&](auto lie) { dark_of<N, decltype(lie)::value>(job, r, s, dark); });
  }
  template <int N, Lie kLie>
  static inline void dark_of(const BlendJob& job, std::size_t r, const Steps& s, std::array<Rows, N>& dark) {
    const PatchRecord& record = job.grid->records[r];
    const Places at = places_of(*job.grid, record, s);
    std::array<Patch, N> patch;
    load_patch<N, kLie>(job.plane(record), record, patch);
    for (std::size_t c = 0; c < N; ++c) {
      const V base = all(job.component[c].black);
      if (!job.curves) {
        dark[c] = mix(patch[c], at, base);
        continue;
      }
      const Rows negative = mix(patch[c], at, _mm512_setzero_si512());
      const Pieces<32>& curve = job.curve[record.head][job.component[c].tone];
      dark[c] = {curved(negative.even, curve, base), curved(negative.odd, curve, base)};
    }
    if (!job.gains) return;
    const bool alone = job.grid->gains.empty();
    const Rows vignetting = alone ? Rows{} : bilinear(job.grid->gains[r].data(), s);
    for (std::size_t c = 0; c < N; ++c) {
      const V head = all(job.gain(record.head, c));
      const V even = alone ? head : _mm512_mulhrs_epi16(vignetting.even, head);
      const V odd = alone ? head : _mm512_mulhrs_epi16(vignetting.odd, head);
      dark[c] = {_mm512_mulhrs_epi16(dark[c].even, even), _mm512_mulhrs_epi16(dark[c].odd, odd)};
    }
  }

  /// Asks for the patch of a record that is still to come. Always inlined: GCC 12 leaves out calls of functions that do
  /// nothing else.
  template <int N>
  [[gnu::always_inline]] static inline void prefetch(const BlendJob& job, std::size_t r) {
    const auto& records = job.grid->records;
    const PatchRecord& record = records[std::min(r, records.size() - 1)];
    const PatchPlane& plane = job.plane(record);
    const int rows = (std::max(record.rows[0], record.rows[1]) >> 4) + 2;
    const std::ptrdiff_t at = record.top * plane.row_stride + std::ptrdiff_t{record.left} * plane.group;
    const std::ptrdiff_t reach = std::ptrdiff_t{kPatch} * plane.group - 1;
    for (std::size_t c = 0; c < (plane.lie == Lie::kPlanar ? N : 1); ++c) {
      const std::uint8_t* from = plane.data[c] + at;
      for (int y = 0; y < rows; ++y, from += plane.row_stride) {
        _mm_prefetch(from, _MM_HINT_T0);  // a row may lie across two lines
        _mm_prefetch(from + reach, _MM_HINT_T0);
      }
    }
  }

  template <int N>
  static inline void finish(const BlendJob& job, const std::array<Rows, N>& light, bool negative, std::uint8_t* out) {
    for (std::size_t c = 0; c < N; ++c) {
      const JobComponent& component = job.component[c];
      V even = light[c].even;
      V odd = light[c].odd;
      if (component.output_curve) {
        if (negative) {
          even = _mm512_sub_epi16(_mm512_setzero_si512(), even);
          odd = _mm512_sub_epi16(_mm512_setzero_si512(), odd);
        }
        even = developed(even, job.output[component.tone]);
        odd = developed(odd, job.output[component.tone]);
      } else {
        const V scale = all(negative ? -component.scale : component.scale);
        const V black = all(component.black_level);
        even = _mm512_add_epi16(_mm512_mulhrs_epi16(even, scale), black);
        odd = _mm512_add_epi16(_mm512_mulhrs_epi16(odd, scale), black);
      }
      _mm512_store_si512(out + c * kStrip, _mm512_packus_epi16(even, odd));
    }
  }

  template <int N>
  static inline void tile(const BlendJob& job, const Tile& tile, std::size_t records, std::uint8_t* out) {
    const Steps s = steps();
    std::array<Rows, N> dark;
    if (records == 1 && tile.how() == Sharing::kAlone) {
      prefetch<N>(job, tile.record + kAhead);
      dark_of<N>(job, tile.record, s, dark);
      return finish<N>(job, dark, true, out);
    }
    std::array<Rows, N> light{};
    const std::int16_t* weights = job.grid->weights.data() + tile.weights();
    const Sharing how = tile.how();
    Rows rest{all(-32768), all(-32768)};
    for (std::size_t r = 0; r < records; ++r) {
      prefetch<N>(job, tile.record + r + kAhead);
      Rows weight = rest;
      if (r + 1 < records || how == Sharing::kOpen) {
        if (how == Sharing::kBilinear) {
          weight = bilinear(weights, s);
          weights += 4;
        } else {
          weight = {_mm512_loadu_si512(weights), _mm512_loadu_si512(weights + 32)};
          weights += kTilePixels;
        }
        rest = {_mm512_sub_epi16(rest.even, weight.even), _mm512_sub_epi16(rest.odd, weight.odd)};
      }
      dark_of<N>(job, tile.record + r, s, dark);
      for (std::size_t c = 0; c < N; ++c) {
        light[c].even = _mm512_add_epi16(light[c].even, _mm512_mulhrs_epi16(dark[c].even, weight.even));
        light[c].odd = _mm512_add_epi16(light[c].odd, _mm512_mulhrs_epi16(dark[c].odd, weight.odd));
      }
    }
    finish<N>(job, light, false, out);
  }

  template <int N>
  static void samples(const BlendJob& job, const PatchRecord& record, std::array<Dark, N>& samples) {
    const PatchPlane& plane = job.plane(record);
    std::array<Patch, N> patch;
    by_lie<N>(plane.lie, [&](auto lie) { load_patch<N, decltype(lie)::value>(plane, record, patch); });
    const Places at = places_of(*job.grid, record, steps());
    const V zero = _mm512_setzero_si512();
    for (std::size_t c = 0; c < N; ++c) {
      const Rows negative = mix(patch[c], at, zero);
      _mm512_storeu_si512(samples[c].data(), _mm512_sub_epi16(zero, negative.even));
      _mm512_storeu_si512(samples[c].data() + 32, _mm512_sub_epi16(zero, negative.odd));
    }
  }

  template <int N>
  static bool emit(const BlendJob& job, int x, int y, const std::uint8_t* strip) {
    for (std::size_t c = 0; c < N; ++c) {
      const MutablePlaneView& plane = job.out[c];
      if (plane.pixel_stride != 1) return false;
      std::uint8_t* to = plane.data + y * plane.row_stride + x;
      V tiles[8];
      for (std::size_t k = 0; k < 8; ++k) tiles[k] = _mm512_load_si512(strip + c * kStrip + 64 * k);
      // Eight bytes of every tile make a row: an 8x8 transposition of 64-bit numbers.
      V pairs[8];
      for (std::size_t k = 0; k < 8; k += 2) {
        pairs[k] = _mm512_unpacklo_epi64(tiles[k], tiles[k + 1]);      // rows 0 2 4 6
        pairs[k + 1] = _mm512_unpackhi_epi64(tiles[k], tiles[k + 1]);  // rows 1 3 5 7
      }
      for (std::size_t odd = 0; odd < 2; ++odd) {
        const V a = _mm512_shuffle_i64x2(pairs[odd], pairs[2 + odd], 0x44);
        const V b = _mm512_shuffle_i64x2(pairs[4 + odd], pairs[6 + odd], 0x44);
        const V d = _mm512_shuffle_i64x2(pairs[odd], pairs[2 + odd], 0xee);
        const V e = _mm512_shuffle_i64x2(pairs[4 + odd], pairs[6 + odd], 0xee);
        const V rows[4] = {_mm512_shuffle_i64x2(a, b, 0x88), _mm512_shuffle_i64x2(a, b, 0xdd),
                           _mm512_shuffle_i64x2(d, e, 0x88), _mm512_shuffle_i64x2(d, e, 0xdd)};
        for (std::size_t k = 0; k < 4; ++k) {
          std::uint8_t* row = to + static_cast<std::ptrdiff_t>(2 * k + odd) * plane.row_stride;
          if ((reinterpret_cast<std::uintptr_t>(row) & 63) == 0) {
            _mm512_stream_si512(reinterpret_cast<V*>(row), rows[k]);
          } else {
            _mm512_storeu_si512(row, rows[k]);
          }
        }
      }
    }
    return true;
  }

  /// Records between asking for a patch and needing it.
  static constexpr std::size_t kAhead = 256;
};

}  // namespace

void blend_avx512(const BlendJob& job) {
  blend_by<Avx512>(job);
  _mm_sfence();
}

}  // namespace nodal::blend

NODAL_TARGET_END
