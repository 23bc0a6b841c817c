#include "stitch/view/row_avx2.h"

#ifdef __x86_64__
#include <immintrin.h>

namespace nodal::view {
namespace {

[[gnu::target("avx2"), gnu::always_inline]] inline std::int32_t pair_of(const std::int16_t* weights) {
  std::int32_t pair;
  __builtin_memcpy(&pair, weights, sizeof pair);
  return pair;
}

/// Four pixels of a row times their taps, each two added: r r g g | b b 0 0.
[[gnu::target("avx2"), gnu::always_inline]] inline __m256i row_sums(const std::uint8_t* pixels, __m256i across) {
  const __m128i order = _mm_setr_epi8(0, 3, 6, 9, 1, 4, 7, 10, 2, 5, 8, 11, -1, -1, -1, -1);
  const __m128i bytes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(pixels));
  return _mm256_madd_epi16(_mm256_cvtepu8_epi16(_mm_shuffle_epi8(bytes, order)), across);
}

}  // namespace

[[gnu::target("avx2")]] void row_avx2_bilinear(const std::uint8_t* origin, std::ptrdiff_t row_stride, const Taps& taps,
                                               const Curve& curve, int count, std::int16_t* samples) {
  // Two pixels of each of two rows: r r g g b b and two zeros.
  const __m128i order = _mm_setr_epi8(0, 3, 1, 4, 2, 5, -1, -1, 8, 11, 9, 12, 10, 13, -1, -1);
  const __m128i half = _mm_set1_epi32(128), last_half = _mm_set1_epi32(8192);
  Curve at = curve;
  for (int i = 0; i < count; ++i) {
    const std::uint8_t* first =
        origin + (at.y >> Curve::kBits) * row_stride + static_cast<std::ptrdiff_t>(at.x >> Curve::kBits) * 3;
    const __m128i across = _mm_set1_epi32(pair_of(taps.phases[(at.x >> (Curve::kBits - 8)) & 255].data()));
    const __m128i down = _mm_set1_epi32(pair_of(taps.phases[(at.y >> (Curve::kBits - 8)) & 255].data()));
    const __m128i top = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(first));
    const __m128i bottom = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(first + row_stride));
    const __m128i pixels = _mm_shuffle_epi8(_mm_unpacklo_epi64(top, bottom), order);
    const __m128i upper = _mm_madd_epi16(_mm_cvtepu8_epi16(pixels), across);
    const __m128i lower = _mm_madd_epi16(_mm_unpackhi_epi8(pixels, _mm_setzero_si128()), across);
    const __m128i rows = _mm_blend_epi16(_mm_srli_epi32(_mm_add_epi32(upper, half), 8),
                                         _mm_slli_epi32(_mm_srli_epi32(_mm_add_epi32(lower, half), 8), 16), 0xAA);
    const __m128i sum = _mm_srai_epi32(_mm_add_epi32(_mm_madd_epi16(rows, down), last_half), 14);
    _mm_storel_epi64(reinterpret_cast<__m128i*>(samples), _mm_packs_epi32(sum, sum));
    samples += 3;
    at.x += at.dx, at.dx += at.ddx;
    at.y += at.dy, at.dy += at.ddy;
  }
}

[[gnu::target("avx2")]] void row_avx2_bicubic(const std::uint8_t* origin, std::ptrdiff_t row_stride, const Taps& taps,
                                              const Curve& curve, int count, std::int16_t* samples) {
  const __m128i last_half = _mm_set1_epi32(8192);
  Curve at = curve;
  for (int i = 0; i < count; ++i) {
    const std::uint8_t* first = origin + ((at.y >> Curve::kBits) - 1) * row_stride +
                                (static_cast<std::ptrdiff_t>(at.x >> Curve::kBits) - 1) * 3;
    const __m256i across = _mm256_broadcastq_epi64(
        _mm_loadl_epi64(reinterpret_cast<const __m128i*>(taps.phases[(at.x >> (Curve::kBits - 8)) & 255].data())));
    const std::int16_t* vertical = taps.phases[(at.y >> (Curve::kBits - 8)) & 255].data();
    // Sums of two rows: r g of the first, r g of the second | b 0, b 0.
    const __m256i rows01 = _mm256_hadd_epi32(row_sums(first, across), row_sums(first + row_stride, across));
    first += 2 * row_stride;
    const __m256i rows23 = _mm256_hadd_epi32(row_sums(first, across), row_sums(first + row_stride, across));
    const __m256i h01 = _mm256_srai_epi32(_mm256_add_epi32(rows01, _mm256_set1_epi32(128)), 8);
    const __m256i h23 = _mm256_srai_epi32(_mm256_add_epi32(rows23, _mm256_set1_epi32(128)), 8);
    // 16 bits: r0 g0 r1 g1 r2 g2 r3 g3 | b0 0 b1 0 b2 0 b3 0; then channel by channel.
    const __m256i rows = _mm256_shuffle_epi8(
        _mm256_packs_epi32(h01, h23), _mm256_setr_epi8(0, 1, 4, 5, 8, 9, 12, 13, 2, 3, 6, 7, 10, 11, 14, 15, 0, 1, 4, 5,
                                                       8, 9, 12, 13, 2, 3, 6, 7, 10, 11, 14, 15));
    const __m256i down = _mm256_broadcastq_epi64(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(vertical)));
    const __m256i pairs = _mm256_madd_epi16(rows, down);  // r r g g | b b 0 0
    const __m128i sums = _mm_hadd_epi32(_mm256_castsi256_si128(pairs), _mm256_extracti128_si256(pairs, 1));
    const __m128i sum = _mm_srai_epi32(_mm_add_epi32(sums, last_half), 14);
    _mm_storel_epi64(reinterpret_cast<__m128i*>(samples), _mm_packs_epi32(sum, sum));
    samples += 3;
    at.x += at.dx, at.dx += at.ddx;
    at.y += at.dy, at.dy += at.ddy;
  }
}

}  // namespace nodal::view
#endif
