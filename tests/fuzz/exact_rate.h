// Frame rates by their definition, in 128 bits and without FrameRate's formulas, as a reference for the fuzz targets.
#pragma once

#include <cstdint>
#include <optional>

#include "protocol/base/units.h"

namespace nodal::fuzz {

using Wide = unsigned __int128;

/// The greatest common divisor by halving and subtracting.
inline std::uint64_t common_divisor(std::uint64_t a, std::uint64_t b) {
  std::uint64_t twos = 1;
  for (; a % 2 == 0 && b % 2 == 0; a /= 2, b /= 2) twos *= 2;
  while (a != b) {
    if (a % 2 == 0) a /= 2;
    else if (b % 2 == 0) b /= 2;
    else if (a > b) a -= b;
    else b -= a;
  }
  return a * twos;
}

/// The expected result of FrameRate::make().
inline std::optional<FrameRate> allowed_rate(std::uint64_t numerator, std::uint64_t denominator) {
  if (numerator == 0 || denominator == 0) return std::nullopt;
  if (Wide{numerator} > Wide{denominator} * 1000 || Wide{denominator} > Wide{numerator} * 1000) return std::nullopt;
  const std::uint64_t divisor = common_divisor(numerator, denominator);
  if (numerator / divisor > 1'000'000 || denominator / divisor > 1'000'000) return std::nullopt;
  return FrameRate{static_cast<std::uint32_t>(numerator / divisor), static_cast<std::uint32_t>(denominator / divisor)};
}

/// The start of frame n in nanoseconds times the rate's numerator, which needs no rounding.
inline Wide exact_start(FrameRate rate, std::uint64_t n) { return Wide{n} * rate.denominator * 1'000'000'000U; }

/// Whether frame n starts within the nanosecond `at`; for the farthest time, whether it starts then or later.
inline bool begins_at(FrameRate rate, std::uint64_t n, Duration at) {
  if (at < Duration()) return false;
  const Wide from = static_cast<Wide>(at.ns()) * rate.numerator;
  const Wide start = exact_start(rate, n);
  return from <= start && (at.ns() == FrameRate::kFarthestNs || start < from + rate.numerator);
}

/// The number of frames that start within the first `elapsed`, including its last nanosecond; by bisection.
inline std::uint64_t frames_begun(FrameRate rate, Duration elapsed) {
  if (elapsed < Duration()) return 0;
  const Wide end = (static_cast<Wide>(elapsed.ns()) + 1) * rate.numerator;
  std::uint64_t begun = 0;  // exact_start(begun) < end <= exact_start(not_begun)
  std::uint64_t not_begun = ~std::uint64_t{0};
  while (not_begun - begun > 1) {
    const std::uint64_t middle = begun + (not_begun - begun) / 2;
    (exact_start(rate, middle) < end ? begun : not_begun) = middle;
  }
  return begun + 1;
}

}  // namespace nodal::fuzz
