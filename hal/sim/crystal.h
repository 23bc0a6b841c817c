// A simulated clock's crystal with a frequency error.
#pragma once

#include <cstdint>

#include "protocol/base/units.h"

namespace nodal::hal::sim {

inline constexpr std::int64_t kPpbOne = 1'000'000'000;

/// The true duration of `nominal` counted by the crystal; positive ppb is slow. |ppb| < kPpbOne; 128-bit products.
constexpr Duration stretched(Duration nominal, std::int64_t ppb) {
  return nominal +
         Duration::nanoseconds(static_cast<std::int64_t>(static_cast<__int128>(nominal.ns()) * ppb / kPpbOne));
}
/// The inverse, to a nanosecond.
constexpr Duration unstretched(Duration taken, std::int64_t ppb) {
  return Duration::nanoseconds(
      static_cast<std::int64_t>(static_cast<__int128>(taken.ns()) * kPpbOne / (kPpbOne + ppb)));
}

}  // namespace nodal::hal::sim
