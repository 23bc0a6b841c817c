#include "stitch/blend/low_picture.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "stitch/blend/clones.h"
#include "stitch/blend/tone.h"

namespace nodal::blend {
namespace {

/// Rows of each square that are read. More tell little: make_low_picture() smooths over nine squares.
constexpr int kLowRows = 2;
constexpr int kColumns = 4096;  // at once; whole squares of every size

/// The rows of a row of squares that are read.
using Rows = std::array<const std::uint8_t*, kLowRows>;

/// By column: over those rows.
struct Columns {
  alignas(64) std::array<std::uint16_t, kColumns> sum;
  alignas(64) std::array<std::uint8_t, kColumns> least;
  alignas(64) std::array<std::uint8_t, kColumns> most;
};

template <int kStride>
[[gnu::always_inline]] inline void add_up(const Rows& rows, std::size_t count, Columns& columns) {
  const std::uint8_t* const a = rows[0];
  const std::uint8_t* const b = rows[1];
  std::uint16_t* __restrict sum = columns.sum.data();
  std::uint8_t* __restrict least = columns.least.data();
  std::uint8_t* __restrict most = columns.most.data();
  for (std::size_t x = 0; x < count; ++x) {
    const std::size_t at = x * kStride;
    sum[x] = static_cast<std::uint16_t>(a[at] + b[at]);
  }
  for (std::size_t x = 0; x < count; ++x) {
    const std::size_t at = x * kStride;
    least[x] = std::min(a[at], b[at]);
    most[x] = std::max(a[at], b[at]);
  }
}

template <std::size_t kSquare>
[[gnu::always_inline]] inline LowSample sample_of(const Columns& columns, std::size_t begin) {
  std::uint32_t sum = 0;
  std::uint8_t least = 255;
  std::uint8_t most = 0;
  for (std::size_t x = begin; x < begin + kSquare; ++x) sum += columns.sum[x];
  for (std::size_t x = begin; x < begin + kSquare; ++x) least = std::min(least, columns.least[x]);
  for (std::size_t x = begin; x < begin + kSquare; ++x) most = std::max(most, columns.most[x]);
  constexpr std::uint32_t kSamples = kLowRows * kSquare;
  return {static_cast<std::uint16_t>(((sum << kSampleBits) + kSamples / 2) / kSamples), least, most};
}

template <std::size_t kSquare>
[[gnu::always_inline]] inline void make_row_of(const PlaneView& in, int y, const PlaneView& low, std::uint8_t* to) {
  Columns columns;
  constexpr int kSide = kSquare;
  constexpr int kAtOnce = kColumns / kSide;  // squares
  const bool whole = in.width >= kSide && in.pixel_stride <= 4;
  for (int begin = 0; begin < low.width; begin += kAtOnce) {
    const int squares = std::min(kAtOnce, low.width - begin);
    const auto count = static_cast<std::size_t>(squares) * kSquare;
    Rows rows;
    std::array<std::array<std::uint8_t, kColumns>, kLowRows> copied;  // of narrow pictures, or with other strides
    for (std::size_t k = 0; k < kLowRows; ++k) {
      const int line = std::min(kSide * y + kSide / 4 + static_cast<int>(k) * kSide / 2, in.height - 1);
      const std::uint8_t* row = in.data + line * in.row_stride;
      rows[k] = row + std::ptrdiff_t{begin} * kSide * in.pixel_stride;
      if (whole) continue;
      for (std::size_t x = 0; x < count; ++x) {
        const int at = std::min(begin * kSide + static_cast<int>(x), in.width - 1);
        copied[k][x] = row[std::ptrdiff_t{at} * in.pixel_stride];
      }
      rows[k] = copied[k].data();
    }
    switch (whole ? in.pixel_stride : 1) {
      case 1: add_up<1>(rows, count, columns); break;
      case 2: add_up<2>(rows, count, columns); break;
      case 3: add_up<3>(rows, count, columns); break;
      default: add_up<4>(rows, count, columns); break;
    }
    for (std::size_t x = 0; x < static_cast<std::size_t>(squares); ++x) {
      const LowSample sample = sample_of<kSquare>(columns, x * kSquare);
      std::memcpy(to, &sample, sizeof sample);
      to += sizeof sample;
    }
  }
}

NODAL_CLONES void make_row(int square, const PlaneView& in, int y, const PlaneView& low, std::uint8_t* to) {
  switch (square) {
    case 8: make_row_of<8>(in, y, low, to); break;
    case 16: make_row_of<16>(in, y, low, to); break;
    case 32: make_row_of<32>(in, y, low, to); break;
    case 64: make_row_of<64>(in, y, low, to); break;
    case 128: make_row_of<128>(in, y, low, to); break;
    default: make_row_of<256>(in, y, low, to); break;
  }
}

/// Weights (1 2 1) / 4; the darkest and the brightest of all three.
[[gnu::always_inline]] inline LowSample smoothed(const LowSample& before, const LowSample& own,
                                                 const LowSample& after) {
  return {static_cast<std::uint16_t>((before.mean + 2U * own.mean + after.mean + 2) >> 2),
          std::min(std::min(before.least, after.least), own.least),
          std::max(std::max(before.most, after.most), own.most)};
}

/// In place, along rows and then along columns; beyond the edges the edge sample is repeated.
NODAL_CLONES void smooth(LowSample* samples, int width, int height) {
  for (int y = 0; y < height; ++y) {
    LowSample* row = samples + std::ptrdiff_t{y} * width;
    LowSample before = row[0];
    for (int x = 0; x < width; ++x) {
      const LowSample own = row[x];
      row[x] = smoothed(before, own, row[std::min(x + 1, width - 1)]);
      before = own;
    }
  }
  constexpr int kAtOnce = 64;
  for (int begin = 0; begin < width; begin += kAtOnce) {
    const int count = std::min(kAtOnce, width - begin);
    std::array<LowSample, kAtOnce> before;
    std::copy_n(samples + begin, count, before.begin());
    for (int y = 0; y < height; ++y) {
      LowSample* own = samples + std::ptrdiff_t{y} * width + begin;
      const LowSample* after = samples + std::ptrdiff_t{std::min(y + 1, height - 1)} * width + begin;
      for (int x = 0; x < count; ++x) {
        const LowSample here = own[x];
        own[x] = smoothed(before[static_cast<std::size_t>(x)], here, after[x]);
        before[static_cast<std::size_t>(x)] = here;
      }
    }
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
    plane.row_stride = static_cast<std::ptrdiff_t>(sizeof(LowSample)) * plane.width;
    plane.data = memory + low.bytes;
    low.bytes += static_cast<std::size_t>(plane.row_stride * plane.height);
  }
  low.width = low.planes[0].width;
  low.height = low.planes[0].height;
  return low;
}

void make_low_picture(const BlendTable::Source& source, const ImageView& read, std::uint8_t* memory) {
  const ImageView low = low_picture(source, read, memory);
  for (std::size_t c = 0; c < static_cast<std::size_t>(component_count(read.format)); ++c) {
    const PlaneView& plane = low.planes[c];
    auto* samples = reinterpret_cast<LowSample*>(memory);  // prepare_picture() begins it at a multiple of its size
    for (int y = 0; y < plane.height; ++y) {
      make_row(square_of(source, c), read.planes[c], y, plane, memory);
      memory += plane.row_stride;
    }
    smooth(samples, plane.width, plane.height);
  }
}

}  // namespace nodal::blend
