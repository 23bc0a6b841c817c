#include "stitch/view/row_kernel.h"

#include <array>

#include "stitch/view/row_avx2.h"

namespace nodal::view {
namespace {

template <int kChannels, int kTaps>
void run(const std::uint8_t* origin, std::ptrdiff_t row_stride, const Taps& taps, const Curve& curve, int count,
         std::int16_t* samples) {
  Curve at = curve;
  for (int i = 0; i < count; ++i) {
    const std::ptrdiff_t left = (at.x >> Curve::kBits) - taps.before, top = (at.y >> Curve::kBits) - taps.before;
    const auto& across = taps.phases[static_cast<std::size_t>((at.x >> (Curve::kBits - 8)) & 255)];
    const auto& down = taps.phases[static_cast<std::size_t>((at.y >> (Curve::kBits - 8)) & 255)];
    const std::uint8_t* first = origin + top * row_stride + left * kChannels;
    for (int c = 0; c < kChannels; ++c) {
      int sum = 8192;
      for (int j = 0; j < kTaps; ++j) {
        int row = 128;
        for (int k = 0; k < kTaps; ++k) row += across[static_cast<std::size_t>(k)] * first[k * kChannels + c];
        sum += down[static_cast<std::size_t>(j)] * (row >> 8);
        first += row_stride;
      }
      first -= kTaps * row_stride;
      *samples++ = static_cast<std::int16_t>(sum >> 14);
    }
    at.x += at.dx, at.dx += at.ddx;
    at.y += at.dy, at.dy += at.ddy;
  }
}

template <int kTaps>
std::span<const NamedRowKernel> of_taps(int channels) {
  static constexpr std::array kGrey{NamedRowKernel{"scalar", &run<1, kTaps>}};
  if (channels == 1) return kGrey;
#ifdef __x86_64__
  if constexpr (kTaps == 2 || kTaps == 4) {
    static constexpr std::array kColour{NamedRowKernel{"scalar", &run<3, kTaps>},
                                        NamedRowKernel{"avx2", kTaps == 2 ? &row_avx2_bilinear : &row_avx2_bicubic}};
    return std::span(kColour).first(__builtin_cpu_supports("avx2") ? 2 : 1);
  }
#endif
  static constexpr std::array kColour{NamedRowKernel{"scalar", &run<3, kTaps>}};
  return kColour;
}

}  // namespace

std::span<const NamedRowKernel> row_kernels(int channels, const Taps& taps) {
  switch (taps.count) {
    case 1: return of_taps<1>(channels);
    case 2: return of_taps<2>(channels);
    case 4: return of_taps<4>(channels);
    default: return of_taps<6>(channels);
  }
}

RowKernel row_kernel(int channels, const Taps& taps) { return row_kernels(channels, taps).back().run; }

}  // namespace nodal::view
