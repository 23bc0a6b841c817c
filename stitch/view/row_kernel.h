// Samples a row of positions in a raymap, in integers. The scalar kernel is the specification; every other one gives
// the same bytes.
//
// With p the pixels and a, b the taps of the position's two fractions, a sample is
//   h_j = (sum_k a_k p_jk + 128) >> 8,   s = (sum_j b_j h_j + 8192) >> 14:   levels in 1/64,
// and of 16 bits, by the fine taps,
//   s = (sum_j b_j sum_k a_k p_jk + 2^37) >> 38.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "stitch/view/filter.h"
#include "stitch/view/sample.h"

namespace nodal::view {

/// Positions along a row: x, x + dx, x + 2 dx + ddx, ... Relative to the centre of a pixel, in 2^-18 px.
struct Curve {
  static constexpr int kBits = 18;
  std::int32_t x, dx, ddx;
  std::int32_t y, dy, ddy;

  static std::int32_t fixed(double pixels) {
    return static_cast<std::int32_t>(std::floor(pixels * (1 << kBits) + 0.5));
  }
};

/// Pixels to the right of the last tap that RGB24 kernels load but do not use.
inline constexpr int kLoadedBeyond = 2;

/// The level of the mean of `count` samples with this sum.
template <class Sample>
Sample mean_level(int sum, int count) {
  return static_cast<Sample>(std::min(std::max(0, sum + 32 * count) / (64 * count), Samples<Sample>::kMax));
}

/// `origin` is the pixel that positions are relative to. Every tap must be a pixel of the picture; for RGB24, so must
/// kLoadedBeyond pixels to the right of the last tap. `row_stride` is in bytes. Writes count x channels samples, and
/// may overwrite three more.
template <class Sample>
using RowKernelOf = void (*)(const std::uint8_t* origin, std::ptrdiff_t row_stride, const Taps& taps,
                             const Curve& curve, int count, typename Samples<Sample>::Scaled* samples);
using RowKernel = RowKernelOf<std::uint8_t>;

/// The fastest kernel for 1 or 3 packed channels of 8 or 16 bits.
template <class Sample>
RowKernelOf<Sample> row_kernel(int channels, const Taps& taps);

/// All kernels that this machine has for 8 bits, the specification first. There is one kernel for 16 bits.
struct NamedRowKernel {
  const char* name;
  RowKernel run;
};
std::span<const NamedRowKernel> row_kernels(int channels, const Taps& taps);

}  // namespace nodal::view
