// Interpolates pictures that are stored R G B R G B .. for AVX2, pixel by pixel: a load of eight bytes holds a pixel,
// and its right neighbour with all their components. So a pixel takes two loads, where rows of a patch would have to be
// taken apart into components first, and shuffled for each of them. Internal to blend_avx2.cpp, which includes it in
// NODAL_TARGET_BEGIN.
#pragma once

#include <immintrin.h>

#include <array>
#include <cstdint>

#include "stitch/blend/blend_job.h"
#include "stitch/blend/patch_avx2.h"
#include "stitch/blend/places_avx2.h"

namespace nodal::blend {
namespace {

struct TripleConstants {
  using Bytes = std::array<std::uint8_t, 32>;
  using Shorts = std::array<std::int16_t, 16>;
  /// By half of a lane's four groups: spreads the 16-bit number of each of the group's two pixels over 64 bits.
  alignas(32) std::array<Bytes, 4> of_pixel;
  /// R R G G B B of a pixel and its neighbour, which begin at byte 0 or at byte 2 of eight bytes.
  alignas(32) std::array<Bytes, 2> pairs;
  /// Largest coordinate: pixels without weight can have any, but must not be read beyond the patch.
  alignas(32) Shorts last;
  alignas(32) Shorts down_bits;
};
constexpr TripleConstants triple_constants() {
  TripleConstants c{};
  for (std::size_t k = 0; k < 32; ++k) {
    for (std::size_t g = 0; g < 4; ++g) c.of_pixel[g][k] = static_cast<std::uint8_t>(4 * g + k % 16 / 8 * 2 + k % 2);
    constexpr std::array<std::uint8_t, 8> kOrder{0, 3, 1, 4, 2, 5, 0x80, 0x80};
    for (std::size_t s = 0; s < 2; ++s) {
      const std::uint8_t at = kOrder[k % 8];
      c.pairs[s][k] = at == 0x80 ? at : static_cast<std::uint8_t>(at + 2 * s + k % 16 / 8 * 8);
    }
  }
  for (std::size_t k = 0; k < 16; ++k) {
    c.last[k] = static_cast<std::int16_t>(((kPatch - 1) << kFractionBits) - 1);
    c.down_bits[k] = 0x7fff;
  }
  return c;
}
constexpr TripleConstants kTripleConstants = triple_constants();

/// Two rows of a tile, by component.
struct RowsOfThree {
  V of[3];
};

/// The pixels of a record's patch.
class Triples {
 public:
  static bool can_read(const PatchPlane& plane) {
    constexpr std::ptrdiff_t kMaxStride = 32767;  // distances of rows are multiplied as 16-bit numbers
    return plane.layout == SampleLayout::kTriples && plane.row_stride <= kMaxStride &&
           plane.row_stride >= -kMaxStride && plane.views[0].width > kPatch;
  }

  [[gnu::always_inline]] Triples(const BlendJob& job, const PatchPlane& plane, const PatchRecord& record)
      : stride_(plane.row_stride) {
    // Of the eight bytes two are not needed. At the right edge they are those before the pixel, so that nothing is read
    // beyond the last row.
    const std::size_t before = record.left + kPatch < plane.views[0].width ? 0 : 1;
    from_ = plane.data[0] + record.top * stride_ + std::ptrdiff_t{record.left} * 3 - 2 * static_cast<int>(before);
    picks_ = load(&out_of_sight(kTripleConstants).pairs[before]);
    steps_ = _mm256_set1_epi32(static_cast<int>(static_cast<std::uint32_t>(stride_) << 16 | 3));
    std::uint64_t base = 0;
    for (std::size_t c = 3; c-- > 0;)
      base = base << 16 | static_cast<std::uint16_t>(std::int16_t{job.component[c].black});
    base_ = _mm256_set1_epi64x(static_cast<std::int64_t>(base));
  }

  /// base - sample, by component, at the coordinates of two rows of a tile, whose pixels are ordered by quarters; base
  /// is 128 times black.
  [[gnu::always_inline]] RowsOfThree mix(V x, V y) const {
    const Constants& k = out_of_sight(kConstants);
    const TripleConstants& t = out_of_sight(kTripleConstants);
    x = _mm256_min_epu16(x, load(&t.last));
    y = _mm256_min_epu16(y, load(&t.last));
    const V column = _mm256_srli_epi16(x, kFractionBits);
    const V row = _mm256_srli_epi16(y, kFractionBits);
    alignas(32) std::array<std::array<std::int32_t, 8>, 2> offset;  // pixels 0 - 3 and 4 - 7 of both quarters
    const auto store = [&](std::size_t which, V of) {
      _mm256_store_si256(reinterpret_cast<V*>(offset[which].data()), _mm256_madd_epi16(of, steps_));
    };
    store(0, _mm256_unpacklo_epi16(column, row));
    store(1, _mm256_unpackhi_epi16(column, row));
    // Loads from memory cost less than taking numbers out of registers, and a second base less than additions; GCC
    // thinks otherwise.
    const std::uint8_t* below = from_ + stride_;
    asm("" : "+m"(offset), "+r"(below));
    const V across = across_shares(k, x);
    const V down = _mm256_and_si256(_mm256_slli_epi16(y, 15 - kFractionBits), load(&t.down_bits));
    V mixed[4];  // R G B and a zero of two pixels of each quarter
#pragma GCC unroll 4
    for (std::size_t g = 0; g < 4; ++g) {
      const std::int32_t* at = &offset[g / 2][g % 2 * 2];
      const V of_pixel = load(&t.of_pixel[g]);
      const V share = _mm256_shuffle_epi8(across, of_pixel);
      const V upper = _mm256_maddubs_epi16(pairs(from_, at), share);  // both negative
      const V lower = _mm256_maddubs_epi16(pairs(below, at), share);
      const V more = _mm256_mulhrs_epi16(_mm256_sub_epi16(lower, upper), _mm256_shuffle_epi8(down, of_pixel));
      mixed[g] = add(add(upper, base_), more);
    }
    const auto apart = [](V a, V b, V& rg, V& b0) {
      const V even = _mm256_unpacklo_epi16(a, b), odd = _mm256_unpackhi_epi16(a, b);
      rg = _mm256_unpacklo_epi16(even, odd);
      b0 = _mm256_unpackhi_epi16(even, odd);
    };
    V rg[2], b0[2];
    apart(mixed[0], mixed[1], rg[0], b0[0]);
    apart(mixed[2], mixed[3], rg[1], b0[1]);
    return {{_mm256_unpacklo_epi64(rg[0], rg[1]), _mm256_unpackhi_epi64(rg[0], rg[1]),
             _mm256_unpacklo_epi64(b0[0], b0[1])}};
  }

 private:
  /// The samples of four pixels and of their right neighbours. Broadcasts and blends, because shuffles are the scarcer.
  [[gnu::always_inline]] V pairs(const std::uint8_t* from, const std::int32_t* at) const {
    const auto eight = [&](std::size_t k) __attribute__((always_inline)) {
      return _mm256_broadcastq_epi64(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(from + at[k])));
    };
    const V left = _mm256_blend_epi32(eight(0), eight(1), 0x0c);
    const V right = _mm256_blend_epi32(eight(4), eight(5), 0xc0);
    return _mm256_shuffle_epi8(_mm256_blend_epi32(left, right, 0xf0), picks_);
  }

  const std::uint8_t* from_;
  std::ptrdiff_t stride_;
  V picks_;
  V steps_;  ///< 3 and the distance of rows, for 32-bit numbers of column and row
  V base_;
};

}  // namespace
}  // namespace nodal::blend
