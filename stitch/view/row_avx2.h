// Kernels of row_kernel.h for RGB24 by AVX2.
#pragma once

#include <cstddef>
#include <cstdint>

#include "stitch/view/row_kernel.h"

namespace nodal::view {

void row_avx2_bilinear(const std::uint8_t* origin, std::ptrdiff_t row_stride, const Taps& taps, const Curve& curve,
                       int count, std::int16_t* samples);
void row_avx2_bicubic(const std::uint8_t* origin, std::ptrdiff_t row_stride, const Taps& taps, const Curve& curve,
                      int count, std::int16_t* samples);

}  // namespace nodal::view
