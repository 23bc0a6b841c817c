#include "stitch/view/row_kernel.h"

#include <array>
#include <type_traits>

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

template <int kChannels, int kTaps>
void run_16(const std::uint8_t* origin, std::ptrdiff_t row_stride, const Taps& taps, const Curve& curve, int count,
            std::int32_t* samples) {
  constexpr int kBytes = 2 * kChannels;
  Curve at = curve;
  for (int i = 0; i < count; ++i) {
    const std::ptrdiff_t left = (at.x >> Curve::kBits) - taps.before, top = (at.y >> Curve::kBits) - taps.before;
    const auto& across = taps.fine[static_cast<std::size_t>((at.x >> (Curve::kBits - 8)) & 255)];
    const auto& down = taps.fine[static_cast<std::size_t>((at.y >> (Curve::kBits - 8)) & 255)];
    const std::uint8_t* first = origin + top * row_stride + left * kBytes;
    std::array<std::int64_t, kChannels> sums;
    sums.fill(std::int64_t{1} << 37);
    for (int j = 0; j < kTaps; ++j, first += row_stride) {
      for (int c = 0; c < kChannels; ++c) {
        std::int64_t row = 0;
        for (int k = 0; k < kTaps; ++k) {
          row += std::int64_t{across[static_cast<std::size_t>(k)]} * load<std::uint16_t>(first + k * kBytes + 2 * c);
        }
        sums[static_cast<std::size_t>(c)] += down[static_cast<std::size_t>(j)] * row;
      }
    }
    for (const std::int64_t sum : sums) *samples++ = static_cast<std::int32_t>(sum >> 38);
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

/// What `of` gives for the number of taps as a constant.
template <class Of>
auto by_count(const Taps& taps, const Of& of) {
  switch (taps.count) {
    case 1: return of(std::integral_constant<int, 1>());
    case 2: return of(std::integral_constant<int, 2>());
    case 4: return of(std::integral_constant<int, 4>());
    default: return of(std::integral_constant<int, 6>());
  }
}

}  // namespace

std::span<const NamedRowKernel> row_kernels(int channels, const Taps& taps) {
  return by_count(taps, [channels](auto count) { return of_taps<count()>(channels); });
}

template <>
RowKernel row_kernel<std::uint8_t>(int channels, const Taps& taps) {
  return row_kernels(channels, taps).back().run;
}

template <>
RowKernelOf<std::uint16_t> row_kernel<std::uint16_t>(int channels, const Taps& taps) {
  return by_count(taps, [channels](auto count) { return channels == 1 ? &run_16<1, count()> : &run_16<3, count()>; });
}

}  // namespace nodal::view
