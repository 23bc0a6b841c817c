#include "stitch/decode/recode.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "stitch/blend/clones.h"

namespace nodal::decode {
namespace {

constexpr int kRecodeBits = 14;
constexpr int kRecodeHalf = 1 << (kRecodeBits - 1);

/// Coefficients in 1 / 2^kRecodeBits: a result is luma * (Y - black) + u * (U - 128) + v * (V - 128).
struct Row {
  int luma = 0, u = 0, v = 0;
};
struct Matrix {
  int black = 0;
  std::array<Row, 3> to{};  ///< rows that give Y, U and V
};

/// The luma shares of red and blue; green has the rest.
struct Primaries {
  double red, blue;
};
constexpr Primaries k601{0.299, 0.114};
constexpr Primaries k709{0.2126, 0.0722};

int fixed(double value) { return static_cast<int>(std::lround(value * (1 << kRecodeBits))); }

Matrix matrix_of(const ColourCoding& coding) {
  const Primaries from = coding.bt709 ? k709 : k601;
  const double luma_gain = coding.video_range ? 255.0 / 219 : 1.0;
  const double chroma_gain = coding.video_range ? 255.0 / 224 : 1.0;
  // R G B = Y + these shares of (U, V), for U and V of -0.5..0.5.
  const double red_v = 2 * (1 - from.red);
  const double blue_u = 2 * (1 - from.blue);
  const double green = 1 - from.red - from.blue;
  const double green_u = -blue_u * from.blue / green;
  const double green_v = -red_v * from.red / green;
  const double luma_u = k601.blue * blue_u + (1 - k601.red - k601.blue) * green_u;
  const double luma_v = k601.red * red_v + (1 - k601.red - k601.blue) * green_v;
  const auto row = [&](double y, double u, double v) {
    return Row{fixed(y * luma_gain), fixed(u * chroma_gain), fixed(v * chroma_gain)};
  };
  const double per_u = 0.5 / (1 - k601.blue);  // U = (B - Y) per_u, V = (R - Y) per_v
  const double per_v = 0.5 / (1 - k601.red);
  return {coding.video_range ? 16 : 0,
          {row(1, luma_u, luma_v), row(0, (blue_u - luma_u) * per_u, -luma_v * per_u),
           row(0, -luma_u * per_v, (red_v - luma_v) * per_v)}};
}

[[gnu::always_inline]] inline std::uint8_t clipped(int value) {
  return static_cast<std::uint8_t>(std::clamp(value, 0, 255));
}

/// One row's chroma, for the luma rows that it belongs to.
struct ChromaRow {
  const std::uint8_t* u;
  const std::uint8_t* v;
};

/// Pixels 2 i and 2 i + 1 have chroma sample i.
template <int kLuma, int kChroma>
[[gnu::always_inline]] inline void luma_row(const Matrix& m, const std::uint8_t* luma, ChromaRow chroma,
                                            std::uint8_t* out, int width) {
  const Row row = m.to[0];
  for (int i = 0; i < width / 2; ++i) {
    const int base = row.u * (chroma.u[i * kChroma] - 128) + row.v * (chroma.v[i * kChroma] - 128) + kRecodeHalf;
    out[2 * i * kLuma] = clipped((row.luma * (luma[2 * i * kLuma] - m.black) + base) >> kRecodeBits);
    out[(2 * i + 1) * kLuma] = clipped((row.luma * (luma[(2 * i + 1) * kLuma] - m.black) + base) >> kRecodeBits);
  }
  if (width % 2 == 0) return;
  const int i = width / 2;
  const int base = row.u * (chroma.u[i * kChroma] - 128) + row.v * (chroma.v[i * kChroma] - 128) + kRecodeHalf;
  out[2 * i * kLuma] = clipped((row.luma * (luma[2 * i * kLuma] - m.black) + base) >> kRecodeBits);
}

template <int kFrom, int kTo>
[[gnu::always_inline]] inline void chroma_row(const Matrix& m, ChromaRow from, std::uint8_t* u, std::uint8_t* v,
                                              int width) {
  const Row to_u = m.to[1];
  const Row to_v = m.to[2];
  for (int i = 0; i < width; ++i) {
    const int a = from.u[i * kFrom] - 128;
    const int b = from.v[i * kFrom] - 128;
    u[i * kTo] = clipped(128 + ((to_u.u * a + to_u.v * b + kRecodeHalf) >> kRecodeBits));
    v[i * kTo] = clipped(128 + ((to_v.u * a + to_v.v * b + kRecodeHalf) >> kRecodeBits));
  }
}

/// The strides of the samples of luma and chroma are the same in both pictures, as their format is.
template <int kLuma, int kChroma>
[[gnu::always_inline]] inline void recode_planes(const Matrix& m, const ImageView& from, const MutableImageView& into) {
  const PlaneView& u = from.planes[1];
  const PlaneView& v = from.planes[2];
  const int rows_each = (from.height + u.height - 1) / u.height;
  for (int y = 0; y < from.height; ++y) {
    const std::ptrdiff_t row = y / rows_each;
    luma_row<kLuma, kChroma>(m, from.planes[0].data + y * from.planes[0].row_stride,
                             {u.data + row * u.row_stride, v.data + row * v.row_stride},
                             into.planes[0].data + y * into.planes[0].row_stride, from.width);
  }
  for (int y = 0; y < u.height; ++y) {
    chroma_row<kChroma, kChroma>(m, {u.data + y * u.row_stride, v.data + y * v.row_stride},
                                 into.planes[1].data + y * into.planes[1].row_stride,
                                 into.planes[2].data + y * into.planes[2].row_stride, u.width);
  }
}

NODAL_CLONES void recode_by(const Matrix& m, const ImageView& from, const MutableImageView& into) {
  switch (into.planes[1].pixel_stride) {
    case 1: return recode_planes<1, 1>(m, from, into);
    case 2: return recode_planes<1, 2>(m, from, into);
    default: return recode_planes<2, 4>(m, from, into);
  }
}

}  // namespace

void recode(const ImageView& from, const MutableImageView& into) { recode_by(matrix_of(from.coding), from, into); }

}  // namespace nodal::decode
