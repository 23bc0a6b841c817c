#include "hal/sim/scene/packing.h"

#include <algorithm>

namespace nodal::hal::sim {

namespace {

constexpr int kShift = 15;  // fraction bits of the matrix's entries

std::uint8_t to_level(int value, int bits) {
  return static_cast<std::uint8_t>(std::clamp((value + (1 << (bits - 1))) >> bits, 0, 255));
}

// BT.601 (JFIF 1.02), coefficients in 1 / 2^15; each row sums to 1 or 0 exactly.
int luma(int r, int g, int b) { return 9798 * r + 19235 * g + 3735 * b; }
int chroma_u(int r, int g, int b) { return -5529 * r - 10855 * g + 16384 * b; }
int chroma_v(int r, int g, int b) { return 16384 * r - 13720 * g - 2664 * b; }

std::uint8_t chroma_level(int value, int bits) {
  return static_cast<std::uint8_t>(std::clamp(((value + (1 << (bits - 1))) >> bits) + 128, 0, 255));
}

// With the stride known at compile time, the compiler vectorizes this.
template <int kStride>
void pack_luma(const RowPair& rows, int r, int x0, int x1, std::uint8_t* __restrict out) {
  const auto& row = rows.row[static_cast<std::size_t>(r)];
  const std::int16_t* __restrict red = row[0] + (x0 - rows.x0);
  const std::int16_t* __restrict green = row[1] + (x0 - rows.x0);
  const std::int16_t* __restrict blue = row[2] + (x0 - rows.x0);
  for (int i = 0; i < x1 - x0; ++i) {
    out[i * kStride] = to_level(luma(red[i], green[i], blue[i]) >> kLevelBits, kShift);
  }
}

std::uint8_t* at(const MutableImageView& into, std::size_t c, int x, int y) {
  const MutablePlaneView& plane = into.planes[c];
  return plane.data + y * plane.row_stride + static_cast<std::ptrdiff_t>(x) * plane.pixel_stride;
}

void pack_chroma_420(const RowPair& rows, int y, int x0, int x1, bool second, const MutableImageView& into) {
  for (int x = x0; x < x1; x += 2) {
    const int i = x - rows.x0;
    const int j = x + 1 < into.width ? i + 1 : i;
    int sum[3];
    for (std::size_t c = 0; c < 3; ++c) {
      const std::int16_t* upper = rows.row[0][c];
      const std::int16_t* lower = rows.row[second ? 1 : 0][c];
      sum[c] = upper[i] + upper[j] + lower[i] + lower[j];
    }
    // A sum of four samples has two more bits; the matrix's result still fits 31 bits.
    *at(into, 1, x / 2, y / 2) = chroma_level(chroma_u(sum[0], sum[1], sum[2]) >> kLevelBits, kShift + 2);
    *at(into, 2, x / 2, y / 2) = chroma_level(chroma_v(sum[0], sum[1], sum[2]) >> kLevelBits, kShift + 2);
  }
}

/// Y of pixel x of a row of kYuv411 is byte 6 (x / 4) + kLuma411[x % 4].
constexpr std::array<int, 4> kLuma411{1, 2, 4, 5};

void pack_411(const RowPair& rows, int r, int x0, int x1, int width, std::uint8_t* out) {
  const auto& row = rows.row[static_cast<std::size_t>(r)];
  for (int x = x0; x < x1; ++x) {
    const int i = x - rows.x0;
    std::uint8_t* const group = out + std::ptrdiff_t{6} * (x / 4);
    group[kLuma411[static_cast<std::size_t>(x % 4)]] =
        to_level(luma(row[0][i], row[1][i], row[2][i]) >> kLevelBits, kShift);
    if (x % 4 != 0) continue;
    const int before = x > 0 ? i - 1 : i;
    const int after = x + 1 < width ? i + 1 : i;
    int sum[3];
    for (std::size_t c = 0; c < 3; ++c) sum[c] = row[c][before] + 2 * row[c][i] + row[c][after];
    group[0] = chroma_level(chroma_u(sum[0], sum[1], sum[2]) >> kLevelBits, kShift + 2);
    group[3] = chroma_level(chroma_v(sum[0], sum[1], sum[2]) >> kLevelBits, kShift + 2);
  }
}

void pack_chroma_422(const RowPair& rows, int r, int y, int x0, int x1, const MutableImageView& into) {
  const auto& row = rows.row[static_cast<std::size_t>(r)];
  for (int x = x0; x < x1; x += 2) {
    const int i = x - rows.x0;
    const int before = x > 0 ? i - 1 : i;
    const int after = x + 1 < into.width ? i + 1 : i;
    int sum[3];
    for (std::size_t c = 0; c < 3; ++c) sum[c] = row[c][before] + 2 * row[c][i] + row[c][after];
    *at(into, 1, x / 2, y) = chroma_level(chroma_u(sum[0], sum[1], sum[2]) >> kLevelBits, kShift + 2);
    *at(into, 2, x / 2, y) = chroma_level(chroma_v(sum[0], sum[1], sum[2]) >> kLevelBits, kShift + 2);
  }
}

/// The colour, 0 to 2 for R G B, of a pixel of a Bayer mosaic.
std::size_t mosaic_colour(PixelFormat format, int x, int y) {
  // The pixel of the 2 x 2 pattern that is red.
  const int red_x = format == PixelFormat::kGrbg8 || format == PixelFormat::kBggr8 ? 1 : 0;
  const int red_y = format == PixelFormat::kGbrg8 || format == PixelFormat::kBggr8 ? 1 : 0;
  const bool red_column = x % 2 == red_x;
  const bool red_row = y % 2 == red_y;
  return red_column == red_row ? (red_row ? 0 : 2) : 1;
}

void pack_mosaic(const RowPair& rows, int r, int y, int x0, int x1, PixelFormat format, std::uint8_t* out) {
  for (int x = x0; x < x1; ++x) {
    const std::size_t colour = mosaic_colour(format, x, y);
    *out++ = to_level(rows.row[static_cast<std::size_t>(r)][colour][x - rows.x0], kLevelBits);
  }
}

}  // namespace

void pack_rows(const RowPair& rows, int y, int x0, int x1, const MutableImageView& into) {
  const bool second = y + 1 < into.height;
  for (int r = 0; r < (second ? 2 : 1); ++r) {
    if (into.format == PixelFormat::kRgb24) {
      for (std::size_t c = 0; c < 3; ++c) {
        const std::int16_t* from = rows.row[static_cast<std::size_t>(r)][c] + (x0 - rows.x0);
        std::uint8_t* to = at(into, c, x0, y + r);
        for (int x = x0; x < x1; ++x, ++from, to += 3) *to = to_level(*from, kLevelBits);
      }
      continue;
    }
    if (into.format == PixelFormat::kYuv411) {
      pack_411(rows, r, x0, x1, into.width, at(into, 0, 0, y + r));
      continue;
    }
    std::uint8_t* const out = at(into, 0, x0, y + r);
    if (is_bayer(into.format)) {
      pack_mosaic(rows, r, y + r, x0, x1, into.format, out);
      continue;
    }
    into.planes[0].pixel_stride == 1 ? pack_luma<1>(rows, r, x0, x1, out) : pack_luma<2>(rows, r, x0, x1, out);
    if (into.format == PixelFormat::kYuyv || into.format == PixelFormat::kUyvy || into.format == PixelFormat::kI422) {
      pack_chroma_422(rows, r, y + r, x0, x1, into);
    }
  }
  if (into.format == PixelFormat::kI420 || into.format == PixelFormat::kNv12) {
    pack_chroma_420(rows, y, x0, x1, second, into);
  }
}

}  // namespace nodal::hal::sim
