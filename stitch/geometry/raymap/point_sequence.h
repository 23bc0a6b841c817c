// The raymaps of low-discrepancy points (§5).
#pragma once

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// Pixel k = j W + i of N = W H has sin phi = 2 u - 1 and theta = 2 pi (v - 1/2), so that points spread evenly over the
/// unit square spread evenly over the sphere. radical_inverse(b, k) is k with its digits to the base b mirrored at the
/// point. A pixel represents 4 pi / N on average.

/// (u, v) = ((k + 1/2) / N, radical_inverse(2, k)): Hammersley's sequence with van der Corput's (base 2).
Result<std::unique_ptr<RaymapLayout>> make_hammersley(RaymapSize size, std::int64_t);
/// (u, v) = (radical_inverse(2, k + 1), radical_inverse(3, k + 1)): Halton's sequence.
Result<std::unique_ptr<RaymapLayout>> make_halton(RaymapSize size, std::int64_t);

}  // namespace nodal::geometry
