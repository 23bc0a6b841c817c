#include "stitch/blend/low_picture.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <type_traits>

#include "stitch/blend/clones.h"
#include "stitch/blend/tone.h"

namespace nodal::blend {
namespace {

/// Rows of each square that are read. More tell little: make_low_picture() smooths over nine squares.
constexpr std::size_t kLowRows = 2;
constexpr std::size_t kColumns = 4096;  // at once; whole squares of every size
constexpr std::size_t kEight = sizeof(std::uint64_t);
/// Rows of squares are computed in whole registers.
constexpr std::size_t kVector = 32;
/// The widest picture has 65535 columns.
constexpr std::size_t kMaxSquares = 65536 / kMinLowSize;

/// A row of squares, by what LowSample holds; with room for one more on both sides and for whole registers.
struct LowRow {
  static constexpr std::size_t kFirst = 1;
  static constexpr std::size_t kSize = kMaxSquares + 2 * kVector;
  alignas(64) std::array<std::uint16_t, kSize> mean;
  alignas(64) std::array<std::uint8_t, kSize> least;
  alignas(64) std::array<std::uint8_t, kSize> most;
};

/// Sum, darkest and brightest sample of two rows of a picture, by eight columns, afterwards by square.
struct Columns {
  alignas(64) std::array<std::uint32_t, kColumns / kEight> sum;
  alignas(64) std::array<std::uint8_t, kColumns / kEight> least;
  alignas(64) std::array<std::uint8_t, kColumns / kEight> most;
};

/// Four times eight samples, or four numbers. Registers, because loads of what was just stored elsewhere have to wait.
using Samples [[gnu::vector_size(32)]] = std::uint8_t;
using Eights [[gnu::vector_size(32)]] = std::uint64_t;

/// The least or (kMax) the greatest of each eight samples, in the lowest byte.
template <bool kMax>
[[gnu::always_inline]] inline void reduce(const Samples& of, Eights& to) {
  Samples all = of;
  for (const int bits : {32, 16, 8}) {
    const auto other = reinterpret_cast<Samples>(reinterpret_cast<Eights>(all) >> bits);
    all = kMax ? (all > other ? all : other) : (all < other ? all : other);
  }
  to = reinterpret_cast<Eights>(all) & 0xff;
}
/// Adds sums of two neighbouring samples each, as four 16-bit numbers.
[[gnu::always_inline]] inline void add_pairs(const Samples& of, Eights& to) {
  const auto all = reinterpret_cast<Eights>(of);
  to += (all & 0x00ff00ff00ff00ff) + (all >> 8 & 0x00ff00ff00ff00ff);
}

using Words [[gnu::vector_size(32)]] = std::uint16_t;
using Doubles [[gnu::vector_size(32)]] = std::uint32_t;
// Results are parameters: without AVX such registers are not returned.
struct LeastOf {
  [[gnu::always_inline]] static void apply(const Samples& a, const Samples& b, Samples& to) { to = a < b ? a : b; }
};
struct MostOf {
  [[gnu::always_inline]] static void apply(const Samples& a, const Samples& b, Samples& to) { to = a > b ? a : b; }
};
struct SumOf {
  [[gnu::always_inline]] static void apply(const Samples& a, const Samples& b, Samples& to) {
    to = reinterpret_cast<Samples>(reinterpret_cast<Words>(a) + reinterpret_cast<Words>(b));
  }
};

/// Reduces the upper and the lower half of each number to one: those of `a` to the lower half of the result's, those of
/// `b` to the upper half.
template <class Numbers, class Use>
[[gnu::always_inline]] inline void join_halves(const Samples& a, const Samples& b, Samples& to) {
  constexpr int kBits = 4 * sizeof(Numbers{}[0]);
  const auto x = reinterpret_cast<Numbers>(a), y = reinterpret_cast<Numbers>(b);
  const Numbers lower = (x << kBits >> kBits) | (y << kBits);
  const Numbers upper = (x >> kBits) | (y >> kBits << kBits);
  Use::apply(reinterpret_cast<Samples>(lower), reinterpret_cast<Samples>(upper), to);
}

/// Reduces each eight bytes of eight registers to one byte; in the order of the registers.
template <class Use>
[[gnu::always_inline]] inline void reduce_eight(const Samples (&of)[8], Samples& to) {
  Samples four[4], two[2], all;
  for (std::size_t k = 0; k < 4; ++k) join_halves<Words, Use>(of[2 * k], of[2 * k + 1], four[k]);
  for (std::size_t k = 0; k < 2; ++k) join_halves<Doubles, Use>(four[2 * k], four[2 * k + 1], two[k]);
  join_halves<Eights, Use>(two[0], two[1], all);
  // Byte j of number k is that of register j.
  to = __builtin_shufflevector(all, all, 0, 8, 16, 24, 1, 9, 17, 25, 2, 10, 18, 26, 3, 11, 19, 27, 4, 12, 20, 28, 5, 13,
                               21, 29, 6, 14, 22, 30, 7, 15, 23, 31);
}

/// Sums of each four of the 16-bit numbers of four registers; in the order of the registers.
[[gnu::always_inline]] inline void sum_fours(const Samples* of, std::uint32_t* to) {
  Samples two[2], all;
  for (std::size_t k = 0; k < 2; ++k) join_halves<Doubles, SumOf>(of[2 * k], of[2 * k + 1], two[k]);
  join_halves<Eights, SumOf>(two[0], two[1], all);
  const auto whole = reinterpret_cast<Words>(all);
  const Words sums = __builtin_shufflevector(whole, whole, 0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
  for (std::size_t k = 0; k < 16; ++k) to[k] = sums[k];
}

/// Columns that are added up together.
constexpr std::size_t kAtOnce = 8 * sizeof(Samples);

/// add_up() of kAtOnce columns, from column `begin` on.
[[gnu::always_inline]] inline void add_up_together(const std::uint8_t* a, const std::uint8_t* b, std::size_t begin,
                                                   Columns& columns) {
  Samples least[8], most[8], pairs[8];
  for (std::size_t k = 0; k < 8; ++k) {
    Samples upper, lower;
    std::memcpy(&upper, a + begin + k * sizeof upper, sizeof upper);
    std::memcpy(&lower, b + begin + k * sizeof lower, sizeof lower);
    LeastOf::apply(upper, lower, least[k]);
    MostOf::apply(upper, lower, most[k]);
    const auto x = reinterpret_cast<Words>(upper), y = reinterpret_cast<Words>(lower);
    pairs[k] = reinterpret_cast<Samples>((x & 255) + (x >> 8) + (y & 255) + (y >> 8));
  }
  Samples all;
  reduce_eight<LeastOf>(least, all);
  std::memcpy(columns.least.data() + begin / kEight, &all, sizeof all);
  reduce_eight<MostOf>(most, all);
  std::memcpy(columns.most.data() + begin / kEight, &all, sizeof all);
  for (std::size_t k = 0; k < 8; k += 4) sum_fours(pairs + k, columns.sum.data() + begin / kEight + 4 * k);
}

[[gnu::always_inline]] inline void add_up(const std::uint8_t* a, const std::uint8_t* b, std::size_t count,
                                          Columns& columns) {
  std::size_t begin = 0;
  for (; begin + kAtOnce <= count; begin += kAtOnce) add_up_together(a, b, begin, columns);
  for (; begin < count; begin += sizeof(Samples)) {
    const std::size_t bytes = std::min(sizeof(Samples), count - begin);
    Samples upper{};
    Samples lower{};
    if (bytes == sizeof(Samples)) {
      std::memcpy(&upper, a + begin, sizeof upper);
      std::memcpy(&lower, b + begin, sizeof lower);
    } else {
      std::memcpy(&upper, a + begin, bytes);
      std::memcpy(&lower, b + begin, bytes);
    }
    Eights sums{};
    add_pairs(upper, sums);
    add_pairs(lower, sums);
    sums = (sums & 0x0000ffff0000ffff) + (sums >> 16 & 0x0000ffff0000ffff);
    sums = (sums + (sums >> 32)) & 0xffffffff;
    Eights least;
    Eights most;
    reduce<false>(upper < lower ? upper : lower, least);
    reduce<true>(upper > lower ? upper : lower, most);
    for (std::size_t k = 0; k < 4; ++k) {
      columns.sum[begin / kEight + k] = static_cast<std::uint32_t>(sums[k]);
      columns.least[begin / kEight + k] = static_cast<std::uint8_t>(least[k]);
      columns.most[begin / kEight + k] = static_cast<std::uint8_t>(most[k]);
    }
  }
}

/// Samples of a row, one after another; beyond the row's end the last one.
[[gnu::always_inline]] inline void collect(const PlaneView& in, const std::uint8_t* row, int begin, std::size_t count,
                                           std::uint8_t* to) {
  const auto inside = static_cast<std::size_t>(std::clamp(in.width - begin, 0, static_cast<int>(count)));
  const std::uint8_t* from = row + std::ptrdiff_t{begin} * in.pixel_stride;
  const auto copy = [&](auto stride) __attribute__((always_inline)) {
    for (std::size_t x = 0; x < inside; ++x) to[x] = from[x * stride];
  };
  switch (in.pixel_stride) {
    case 2: copy(std::integral_constant<std::size_t, 2>()); break;
    case 3: copy(std::integral_constant<std::size_t, 3>()); break;
    case 4: copy(std::integral_constant<std::size_t, 4>()); break;
    default: copy(static_cast<std::size_t>(in.pixel_stride)); break;
  }
  std::fill(to + inside, to + count, row[std::ptrdiff_t{in.width - 1} * in.pixel_stride]);
}

/// Line k that is read of row y of squares.
[[gnu::always_inline]] inline const std::uint8_t* line_of(int square, const PlaneView& in, int y, std::size_t k) {
  const int line = std::min(square * y + square / 4 + static_cast<int>(k) * square / 2, in.height - 1);
  return in.data + line * in.row_stride;
}

/// The processor's own prefetch begins anew with each line.
[[gnu::always_inline]] inline void prefetch_row(int square, const PlaneView& in, int y) {
  for (std::size_t k = 0; k < kLowRows; ++k) {
    const std::uint8_t* line = line_of(square, in, y, k);
    for (std::ptrdiff_t at = 0; at < std::ptrdiff_t{in.width} * in.pixel_stride; at += 64)
      __builtin_prefetch(line + at);
  }
}

/// Row y of squares, not smoothed.
[[gnu::always_inline]] inline void make_row(int square, const PlaneView& in, int y, int width, LowRow& row) {
  Columns columns;
  const int at_once = static_cast<int>(kColumns) / square;  // squares
  const int shift = std::countr_zero(kLowRows * static_cast<unsigned>(square));
  for (int begin = 0; begin < width; begin += at_once) {
    const auto squares = static_cast<std::size_t>(std::min(at_once, width - begin));
    const std::size_t count = squares * static_cast<std::size_t>(square);
    std::array<const std::uint8_t*, kLowRows> read;
    // Copies of the rows of pictures that are narrow or have gaps.
    std::array<std::array<std::uint8_t, kColumns>, kLowRows> collected;
    for (std::size_t k = 0; k < kLowRows; ++k) {
      const std::uint8_t* from = line_of(square, in, y, k);
      read[k] = from + begin * square;
      if (in.width >= square && in.pixel_stride == 1) continue;
      collect(in, from, begin * square, count, collected[k].data());
      read[k] = collected[k].data();
    }
    add_up(read[0], read[1], count, columns);
    for (std::size_t left = count / kEight / 2; left >= squares; left /= 2) {
      for (std::size_t x = 0; x < left; ++x) {
        columns.sum[x] = columns.sum[2 * x] + columns.sum[2 * x + 1];
        columns.least[x] = std::min(columns.least[2 * x], columns.least[2 * x + 1]);
        columns.most[x] = std::max(columns.most[2 * x], columns.most[2 * x + 1]);
      }
    }
    const std::size_t to = LowRow::kFirst + static_cast<std::size_t>(begin);
    for (std::size_t x = 0; x < squares; ++x) {
      row.mean[to + x] = static_cast<std::uint16_t>(((columns.sum[x] << kSampleBits) + (1U << shift >> 1)) >> shift);
    }
    std::copy_n(columns.least.begin(), squares, row.least.begin() + to);
    std::copy_n(columns.most.begin(), squares, row.most.begin() + to);
  }
}

/// By value: GCC does not vectorize std::min of references to three numbers.
[[gnu::always_inline]] inline std::uint8_t least_of(std::uint8_t a, std::uint8_t b, std::uint8_t c) {
  const std::uint8_t both = a < b ? a : b;
  return both < c ? both : c;
}
[[gnu::always_inline]] inline std::uint8_t most_of(std::uint8_t a, std::uint8_t b, std::uint8_t c) {
  const std::uint8_t both = a > b ? a : b;
  return both > c ? both : c;
}

/// Weights (1 2 1) / 4.
[[gnu::always_inline]] inline std::uint32_t smoothed(std::uint32_t before, std::uint32_t own, std::uint32_t after) {
  return (before + 2 * own + after + 2) >> 2;
}

/// Row y of squares, smoothed along the row.
NODAL_CLONES void make_smooth_row(int square, const PlaneView& in, int y, std::size_t width, LowRow& to) {
  prefetch_row(square, in, y + 2);
  LowRow row;
  make_row(square, in, y, static_cast<int>(width), row);
  const std::size_t padded = (width + kVector - 1) / kVector * kVector;
  const auto repeat_edges = [&](auto& of) {
    of[0] = of[1];
    std::fill(of.begin() + width + 1, of.begin() + padded + 2, of[width]);
  };
  repeat_edges(row.mean);
  repeat_edges(row.least);
  repeat_edges(row.most);
  for (std::size_t x = 0; x < padded; ++x) {
    to.mean[x] = static_cast<std::uint16_t>(smoothed(row.mean[x], row.mean[x + 1], row.mean[x + 2]));
  }
  for (std::size_t x = 0; x < padded; ++x) {
    to.least[x] = least_of(row.least[x], row.least[x + 1], row.least[x + 2]);
    to.most[x] = most_of(row.most[x], row.most[x + 1], row.most[x + 2]);
  }
}

/// Three rows of squares, smoothed along the column and stored.
NODAL_CLONES void store_row(const LowRow& before, const LowRow& own, const LowRow& after, std::size_t width,
                            std::uint8_t* to) {
  static_assert(std::endian::native == std::endian::little && offsetof(LowSample, least) == 2);
  std::array<std::uint32_t, LowRow::kSize> samples;  // one LowSample each: so the loop is vectorized
  for (std::size_t x = 0; x < (width + kVector - 1) / kVector * kVector; ++x) {
    const std::uint32_t least = least_of(before.least[x], own.least[x], after.least[x]);
    const std::uint32_t most = most_of(before.most[x], own.most[x], after.most[x]);
    samples[x] = smoothed(before.mean[x], own.mean[x], after.mean[x]) | least << 16 | most << 24;
  }
  std::fill_n(samples.begin() + width, kMoreLowSamples, samples[width - 1]);
  std::memcpy(to, samples.data(), (width + kMoreLowSamples) * sizeof samples[0]);
}

void make_plane(int square, const PlaneView& in, const PlaneView& low, std::uint8_t* to) {
  const auto width = static_cast<std::size_t>(low.width);
  std::array<LowRow, 3> rows;  // row y is the one numbered y modulo 3
  const auto row = [&](int y) __attribute__((always_inline))->LowRow& { return rows[static_cast<std::size_t>(y) % 3]; };
  for (int y = -1; y < low.height; ++y) {
    const int below = std::min(y + 1, low.height - 1);
    if (below > y) make_smooth_row(square, in, below, width, row(below));
    if (y < 0) continue;
    store_row(row(std::max(y - 1, 0)), row(y), row(below), width, to);
    to += low.row_stride;
  }
  for (int k = 0; k < kMoreLowSamples; ++k, to += low.row_stride) {
    std::memcpy(to, to - low.row_stride, static_cast<std::size_t>(low.row_stride));
  }
}

int square_of(const BlendTable::Source& source, std::size_t component) {
  return has_chroma(source.format) && component > 0 ? source.low_size / 2 : source.low_size;
}

}  // namespace

ImageView low_picture(const BlendTable::Source& source, const ImageView& read, const std::uint8_t* memory) {
  ImageView low{read.format, 0, 0, {}, 0};
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(read.format)); ++c) {
    PlaneView& plane = low.planes[c];
    plane.width = std::max(1, read.planes[c].width / square_of(source, c));
    plane.height = std::max(1, read.planes[c].height / square_of(source, c));
    plane.pixel_stride = sizeof(LowSample);
    plane.row_stride = static_cast<std::ptrdiff_t>(sizeof(LowSample)) * (plane.width + kMoreLowSamples);
    plane.data = memory + low.bytes;
    low.bytes += static_cast<std::size_t>(plane.row_stride * (plane.height + kMoreLowSamples));
  }
  low.width = low.planes[0].width;
  low.height = low.planes[0].height;
  return low;
}

void make_low_picture(const BlendTable::Source& source, const ImageView& read, std::uint8_t* memory) {
  const ImageView low = low_picture(source, read, memory);
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(read.format)); ++c) {
    const PlaneView& plane = low.planes[c];
    make_plane(square_of(source, c), read.planes[c], plane, memory);
    memory += plane.row_stride * (plane.height + kMoreLowSamples);
  }
}

}  // namespace nodal::blend
