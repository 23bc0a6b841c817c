// Light in stops: base-2 logarithms as integers, so that exposures give the same sums on every machine.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/base/units.h"

namespace nodal {

/// In 1/1024 of a stop; a stop is a factor of two in light.
using Stops = std::int32_t;
inline constexpr Stops kStop = 1024;

namespace stops_detail {
constexpr std::uint64_t square_root(std::uint64_t x) {
  std::uint64_t root = 0;
  for (int bit = 31; bit >= 0; --bit) {
    const std::uint64_t with = root | (std::uint64_t{1} << bit);
    if (with * with <= x) root = with;
  }
  return root;
}
/// 2^(1/2), 2^(1/4) … 2^(1/1024), in 1 / 2^31.
constexpr std::array<std::uint64_t, 10> kRoots = [] {
  std::array<std::uint64_t, 10> roots{};
  std::uint64_t root = square_root(std::uint64_t{1} << 63);
  for (std::uint64_t& each : roots) {
    each = root;
    root = square_root(root << 31);
  }
  return roots;
}();
}  // namespace stops_detail

/// log2(value), rounded down to 1/1024 of a stop; value > 0.
constexpr Stops log2_stops(std::uint64_t value) {
  int whole = 63;
  while ((value >> whole) == 0) --whole;
  std::uint64_t rest = whole >= 31 ? value >> (whole - 31) : value << (31 - whole);  // 1 .. 2, in 1 / 2^31
  Stops stops = whole * kStop;
  for (Stops bit = kStop / 2; bit > 0; bit /= 2) {
    rest = rest * rest >> 31;
    if (rest >= std::uint64_t{1} << 32) {
      rest >>= 1;
      stops += bit;
    }
  }
  return stops;
}

/// one * 2^(stops / 1024), rounded; 0 if the result is below a half. one < 2^31, and the result must fit 62 bits.
constexpr std::uint64_t exp2_stops(Stops stops, std::uint64_t one = 1) {
  const Stops whole = stops >> 10;
  const auto fraction = static_cast<std::uint32_t>(stops & (kStop - 1));
  std::uint64_t factor = std::uint64_t{1} << 31;
  for (std::size_t k = 0; k < stops_detail::kRoots.size(); ++k) {
    if ((fraction >> (9 - k) & 1) != 0) factor = factor * stops_detail::kRoots[k] >> 31;
  }
  const std::uint64_t product = one * factor;  // below 2^63
  const int shift = 31 - whole;
  if (shift <= 0) return product << -shift;
  if (shift > 63) return 0;
  return (product + (std::uint64_t{1} << (shift - 1))) >> shift;
}

/// The exposure's effect on recorded light: log2 of the shutter time in microseconds plus the gain, in stops.
constexpr Stops stops_of(Exposure exposure) {
  return exposure.duration().ns() > 0
             ? log2_stops(static_cast<std::uint64_t>(exposure.duration().ns())) - log2_stops(1000)
             : 0;
}
constexpr Stops stops_of(Gain gain) {
  const std::int64_t scaled = std::int64_t{gain.mdb()} * kStop * 100;
  return static_cast<Stops>((scaled + (scaled < 0 ? -301'030 : 301'030)) / 602'060);  // 6.0206 dB per stop
}
constexpr Gain gain_of(Stops stops) {
  const std::int64_t scaled = std::int64_t{stops} * 602'060;
  return Gain::millidecibels(static_cast<std::int32_t>((scaled + (scaled < 0 ? -51'200 : 51'200)) / 102'400));
}

}  // namespace nodal
