// The blend by AVX2: the rows of a patch that a quarter of a tile needs are gone through one by one, beside those of the
// quarter on its right, and every row gives, by a shuffle of its 16 bytes, the samples of the pixels that lie in it. A
// quarter is as wide as it is high, so that six rows nearly always do, however the head is turned.
#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <span>

#include "stitch/blend/blend_job.h"
#include "stitch/blend/target.h"

NODAL_TARGET_BEGIN("avx2")

#include "stitch/blend/patch_avx2.h"
#include "stitch/blend/tile_driver.h"

namespace nodal::blend {
namespace {

/// Half a tile in two registers: its upper two rows, and its lower two. A 128-bit lane is a quarter's part of them.
struct Rows {
  V upper;
  V lower;
};

/// i, and of each half of a tile j, jj, 4j + 4 of its upper rows.
struct Steps {
  V i, ii;
  V j[2], jj[2], next[2];
};
inline Steps steps() {
  const V i = _mm256_setr_epi16(0, 1, 2, 3, 0, 1, 2, 3, 4, 5, 6, 7, 4, 5, 6, 7);
  const auto rows = [&](short a, short b) { return _mm256_broadcastsi128_si256(_mm_setr_epi16(a, a, a, a, b, b, b, b)); };
  return {i, mul(i, i), {rows(0, 1), rows(4, 5)}, {rows(0, 1), rows(16, 25)}, {rows(4, 8), rows(20, 24)}};
}

/// A polynomial over a tile, before its rows are told apart.
struct Polynomial {
  V constant;  ///< with what goes with i
  V by_j;
  V by_2j;
  V by_jj;
};
inline Polynomial quadratic(const Quadratic& q, const Steps& s) {
  const V by_j = add(all(q[2]), mul(all(q[3]), s.i));
  return {add(add(all(q[0]), mul(all(q[1]), s.i)), mul(all(q[4]), s.ii)), by_j, add(by_j, by_j), all(q[5])};
}
inline Rows at_half(const Polynomial& p, const Steps& s, std::size_t half) {
  const V upper = add(add(p.constant, mul(p.by_j, s.j[half])), mul(p.by_jj, s.jj[half]));
  return {upper, add(upper, add(p.by_2j, mul(p.by_jj, s.next[half])))};
}
inline Rows bilinear_half(const std::int16_t* q, const Steps& s, std::size_t half) {
  const V by_j = add(all(q[2]), mul(all(q[3]), s.i));
  const V upper = add(add(all(q[0]), mul(all(q[1]), s.i)), mul(by_j, s.j[half]));
  return {upper, add(upper, add(by_j, by_j))};
}

/// Two rows of a tile, by what their quarters have of them. Back again by the same way.
inline V by_quarters(V rows) { return _mm256_permute4x64_epi64(rows, 0xd8); }
/// 64 values by pixel, of half a tile.
template <class Number>
inline Rows listed_half(const Number* values, std::size_t half) {
  const Number* from = values + half * kTilePixels / 2;
  return {by_quarters(load(from)), by_quarters(load(from + 2 * kTile))};
}
inline void list_half(Rows rows, std::size_t half, std::int16_t* values) {
  std::int16_t* to = values + half * kTilePixels / 2;
  _mm256_storeu_si256(reinterpret_cast<V*>(to), by_quarters(rows.upper));
  _mm256_storeu_si256(reinterpret_cast<V*>(to + 2 * kTile), by_quarters(rows.lower));
}

/// Where half a tile's pixels lie in a patch, ready for use.
struct Places {
  V place;      ///< bytes, by pixel: row * 16 + column of the upper left sample
  Rows across;  ///< pairs of bytes: the shares of the left and the right sample, of -128: one is then a byte
  Rows down;    ///< the lower row's share, of 2^15
};

inline V place_in_patch(V x, V y) {
  return _mm256_or_si256(_mm256_and_si256(_mm256_srli_epi16(y, 8), all(0xf0)), _mm256_srli_epi16(x, 12));
}
inline V shares_across(V x) {
  const V f = _mm256_and_si256(_mm256_srli_epi16(x, 5), all(127));
  return _mm256_sub_epi16(add(f, all(128)), _mm256_slli_epi16(f, 8));
}
inline V share_down(V y) { return _mm256_and_si256(_mm256_slli_epi16(y, 3), all(0x7ff8)); }

inline Places places(Rows x, Rows y) {
  return {_mm256_packus_epi16(place_in_patch(x.upper, y.upper), place_in_patch(x.lower, y.lower)),
          {shares_across(x.upper), shares_across(x.lower)},
          {share_down(y.upper), share_down(y.lower)}};
}

/// Both coordinates of a record's pixels.
class Coordinates {
 public:
  Coordinates(const GridTable& grid, const PatchRecord& record, const Steps& s) {
    if (record.listed()) {
      list_ = grid.coordinates.data() + record.list() * 2 * kTilePixels;
    } else {
      x_ = quadratic(record.x, s);
      y_ = quadratic(record.y, s);
    }
  }
  Places half(const Steps& s, std::size_t half) const {
    if (list_ != nullptr) return places(listed_half(list_, half), listed_half(list_ + kTilePixels, half));
    return places(at_half(x_, s, half), at_half(y_, s, half));
  }

 private:
  const std::uint16_t* list_ = nullptr;
  Polynomial x_{};
  Polynomial y_{};
};

/// The four samples of each pixel of half a tile.
struct Samples {
  V p00, p10, p01, p11;
};

/// Takes up what lies in the `span` rows of the patch from where each quarter's pixels begin.
template <class Span>
inline Samples picked(const Patch& patch, V place, const PatchRecord& record, std::size_t half, Span span) {
  const std::uint8_t* left_at = patch.data + record.first_row(half, 0) * patch.stride;
  const std::uint8_t* right_at = patch.data + record.first_row(half, 1) * patch.stride;
  const auto row_at = [&] {
    return _mm256_inserti128_si256(_mm256_castsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(left_at))),
                                   _mm_loadu_si128(reinterpret_cast<const __m128i*>(right_at)), 1);
  };
  // A byte picks when its upper half is 7: its pixel's row less the row at hand is nothing. Else its top bit is set.
  const V mine = _mm256_set1_epi8(0x70);
  const V next = _mm256_set1_epi8(0x71);
  const V step = _mm256_set1_epi8(0x10);
  const V both = _mm256_set1_epi8(static_cast<char>(record.first[half]));
  const V first = _mm256_sllv_epi32(both, _mm256_setr_epi32(4, 4, 4, 4, 0, 0, 0, 0));
  place = _mm256_sub_epi8(place, _mm256_and_si256(first, _mm256_set1_epi8(static_cast<char>(0xf0))));
  V upper = row_at();
  Samples samples{};
  for (int y = 0; y < span; ++y) {
    left_at += patch.stride;
    right_at += patch.stride;
    const V lower = row_at();
    const V left = _mm256_adds_epu8(place, mine);
    const V right = _mm256_adds_epu8(place, next);
    samples.p00 = _mm256_or_si256(samples.p00, _mm256_shuffle_epi8(upper, left));
    samples.p10 = _mm256_or_si256(samples.p10, _mm256_shuffle_epi8(upper, right));
    samples.p01 = _mm256_or_si256(samples.p01, _mm256_shuffle_epi8(lower, left));
    samples.p11 = _mm256_or_si256(samples.p11, _mm256_shuffle_epi8(lower, right));
    place = _mm256_sub_epi8(place, step);
    upper = lower;
  }
  return samples;
}

/// base - sample, base 128 times black, of half a tile.
inline Rows mix(const Patch& patch, const Places& at, const PatchRecord& record, std::size_t half, V base) {
  using Least = std::integral_constant<int, kLeastSpan>;
  const Samples s = record.span() == kLeastSpan ? picked(patch, at.place, record, half, Least())
                                                : picked(patch, at.place, record, half, record.span());
  const auto down = [&](V top, V bottom, V share) {  // both negative
    return add(_mm256_mulhrs_epi16(_mm256_sub_epi16(bottom, top), share), add(base, top));
  };
  return {down(_mm256_maddubs_epi16(_mm256_unpacklo_epi8(s.p00, s.p10), at.across.upper),
               _mm256_maddubs_epi16(_mm256_unpacklo_epi8(s.p01, s.p11), at.across.upper), at.down.upper),
          down(_mm256_maddubs_epi16(_mm256_unpackhi_epi8(s.p00, s.p10), at.across.lower),
               _mm256_maddubs_epi16(_mm256_unpackhi_epi8(s.p01, s.p11), at.across.lower), at.down.lower)};
}

/// Bytes of a table, by bytes that are less than its length.
template <std::size_t kLength>
inline V look_up(const std::uint8_t* of, V index) {
  if constexpr (kLength == 16) {
    return _mm256_shuffle_epi8(row(of), index);
  } else {
    constexpr std::size_t kHalf = kLength / 2;
    const V upper = _mm256_slli_epi16(index, kLength == 64 ? 2 : 3);  // the bit that tells the halves apart is its byte's top
    return _mm256_blendv_epi8(look_up<kHalf>(of, index), look_up<kHalf>(of + kHalf, index), upper);
  }
}

/// curve(at), see curve_at.
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
  template <int N>
  using Halves = std::array<std::array<Rows, 2>, N>;

  /// Light of all components by one record, negative.
  template <int N>
  static inline void dark_of(const BlendJob& job, std::size_t r, const Steps& s, Halves<N>& dark) {
    const PatchRecord& record = job.grid->records[r];
    const Coordinates coordinates(*job.grid, record, s);
    alignas(32) std::array<Staged, N> staged;
    std::array<Patch, N> patch;
    find_patch<N>(job.plane(record), record, staged, patch);
    const bool alone = job.grid->gains.empty();
    for (std::size_t half = 0; half < 2; ++half) {
      const Places at = coordinates.half(s, half);
      const Rows vignetting = !job.gains || alone ? Rows{} : bilinear_half(job.grid->gains[r].data(), s, half);
      for (std::size_t c = 0; c < N; ++c) {
        const V base = all(job.component[c].black);
        Rows value = mix(patch[c], at, record, half, job.curves ? _mm256_setzero_si256() : base);
        if (job.curves) {
          const Pieces<32>& curve = job.curve[record.head()][job.component[c].tone];
          value = negated(on_curve<10>(negated(value, _mm256_setzero_si256()), curve), base);
        }
        if (job.gains) {
          const V head = all(job.gain(record.head(), c));
          const V upper = alone ? head : _mm256_mulhrs_epi16(vignetting.upper, head);
          const V lower = alone ? head : _mm256_mulhrs_epi16(vignetting.lower, head);
          value = {_mm256_mulhrs_epi16(value.upper, upper), _mm256_mulhrs_epi16(value.lower, lower)};
        }
        dark[c][half] = value;
      }
    }
  }

  static inline Rows level_of(const BlendJob& job, std::size_t c, Rows light, bool negative) {
    const JobComponent& component = job.component[c];
    const V zero = _mm256_setzero_si256();
    if (component.output_curve) {
      if (negative) light = negated(light, zero);
      const Rows shown =
          on_curve<9>({_mm256_max_epi16(light.upper, zero), _mm256_max_epi16(light.lower, zero)}, job.output[component.tone]);
      return {_mm256_srai_epi16(add(shown.upper, all(64)), kSampleBits),
              _mm256_srai_epi16(add(shown.lower, all(64)), kSampleBits)};
    }
    const V scale = all(negative ? component.scale_of_dark : component.scale);
    const V black = all(component.black_level);
    return {add(_mm256_mulhrs_epi16(light.upper, scale), black), add(_mm256_mulhrs_epi16(light.lower, scale), black)};
  }

  template <int N>
  static inline void finish(const BlendJob& job, const Halves<N>& light, bool negative, std::uint8_t* out) {
    for (std::size_t c = 0; c < N; ++c) {
      for (std::size_t half = 0; half < 2; ++half) {
        const Rows level = level_of(job, c, light[c][half], negative);
        const V bytes = _mm256_packus_epi16(level.upper, level.lower);  // by quarters
        _mm256_store_si256(reinterpret_cast<V*>(out + c * kStrip + 32 * half),
                           _mm256_permutevar8x32_epi32(bytes, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7)));
      }
    }
  }

  /// Light as it is.
  template <int N>
  static inline void finish(const BlendJob&, const Halves<N>& light, bool negative, std::int16_t* out) {
    for (std::size_t c = 0; c < N; ++c) {
      for (std::size_t half = 0; half < 2; ++half) {
        const Rows rows = negative ? negated(light[c][half], _mm256_setzero_si256()) : light[c][half];
        list_half(rows, half, out + c * kStrip);
      }
    }
  }

  template <int N, class Number>
  static inline void tile(const BlendJob& job, const Tile& tile, std::size_t records, Number* out) {
    const Steps s = steps();
    Halves<N> dark;
    if (records == 1 && tile.how() == Sharing::kAlone) {
      prefetch<N>(job, tile.record);
      dark_of<N>(job, tile.record, s, dark);
      return finish<N>(job, dark, true, out);
    }
    Halves<N> light{};
    const std::int16_t* weights = job.grid->weights.data() + tile.weights();
    const Sharing how = tile.how();
    std::array<Rows, 2> rest;
    rest.fill({all(-32768), all(-32768)});
    for (std::size_t r = 0; r < records; ++r) {
      prefetch<N>(job, tile.record + r);
      dark_of<N>(job, tile.record + r, s, dark);
      const bool given = r + 1 < records || how == Sharing::kOpen;
      for (std::size_t half = 0; half < 2; ++half) {
        Rows weight = rest[half];
        if (given) {
          weight = how == Sharing::kBilinear ? bilinear_half(weights, s, half) : listed_half(weights, half);
          rest[half] = {_mm256_sub_epi16(rest[half].upper, weight.upper), _mm256_sub_epi16(rest[half].lower, weight.lower)};
        }
        for (std::size_t c = 0; c < N; ++c) {
          light[c][half].upper = add(light[c][half].upper, _mm256_mulhrs_epi16(dark[c][half].upper, weight.upper));
          light[c][half].lower = add(light[c][half].lower, _mm256_mulhrs_epi16(dark[c][half].lower, weight.lower));
        }
      }
      weights += how == Sharing::kBilinear ? 4 : kTilePixels;
    }
    finish<N>(job, light, false, out);
  }

  template <int N>
  static void samples(const BlendJob& job, const PatchRecord& record, std::array<Dark, N>& samples) {
    const Steps s = steps();
    const Coordinates coordinates(*job.grid, record, s);
    alignas(32) std::array<Staged, N> staged;
    std::array<Patch, N> patch;
    find_patch<N>(job.plane(record), record, staged, patch);
    const V zero = _mm256_setzero_si256();
    for (std::size_t half = 0; half < 2; ++half) {
      const Places at = coordinates.half(s, half);
      for (std::size_t c = 0; c < N; ++c) {
        const Rows negative = mix(patch[c], at, record, half, zero);
        list_half(negated(negative, zero), half, samples[c].data());
      }
    }
  }

  /// Past the caches, where a whole line will come of it.
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

  template <int N>
  static bool emit(const BlendJob& job, int x, int y, const std::uint8_t* strip) {
    const bool triples = N == 3 && interleaved(job);
    const bool pairs = N == 2 && paired(job);
    if (!triples && !pairs && job.out[0].pixel_stride != 1) return false;
    for (std::size_t j = 0; j < kTile; ++j) {
      const auto eight = [&](std::size_t c, std::size_t tile) {
        std::int64_t bytes;
        std::memcpy(&bytes, strip + c * kStrip + tile * kTilePixels + j * kTile, sizeof bytes);
        return bytes;
      };
      const std::ptrdiff_t row = y + static_cast<std::ptrdiff_t>(j);
      if (triples) {
        std::uint8_t* to = job.out[0].data + row * job.out[0].row_stride + std::ptrdiff_t{x} * 3;
        for (std::size_t k = 0; k < 8; k += 2) {
          for (const auto& picks : kTriplePicks) {
            __m128i bytes = _mm_setzero_si128();
            for (std::size_t c = 0; c < N; ++c) {
              const __m128i of = _mm_set_epi64x(eight(c, k + 1), eight(c, k));
              bytes = _mm_or_si128(bytes, shuffled(of, picks[c]));
            }
            _mm_storeu_si128(reinterpret_cast<__m128i*>(to), bytes);
            to += 16;
          }
        }
        continue;
      }
      if (pairs) {
        std::uint8_t* to = job.out[0].data + row * job.out[0].row_stride + std::ptrdiff_t{x} * 2;
        for (std::size_t k = 0; k < 8; k += 2, to += 32) {
          const __m128i u = _mm_set_epi64x(eight(0, k + 1), eight(0, k));
          const __m128i v = _mm_set_epi64x(eight(N - 1, k + 1), eight(N - 1, k));
          put(to, _mm256_set_m128i(_mm_unpackhi_epi8(u, v), _mm_unpacklo_epi8(u, v)));
        }
        continue;
      }
      for (std::size_t c = 0; c < N; ++c) {
        std::uint8_t* to = job.out[c].data + row * job.out[c].row_stride + x;
        for (std::size_t k = 0; k < 8; k += 4, to += 32) {
          const V four = _mm256_setr_epi64x(eight(c, k), eight(c, k + 1), eight(c, k + 2), eight(c, k + 3));
          put(to, four);
        }
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
