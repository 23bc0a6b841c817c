// Draws values that reveal faults more often than random ones from a fuzzer's input.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include "protocol/base/bytes.h"

namespace nodal::fuzz {

/// 0, 1, the maximum of `bits` bits, a power of two, its two neighbours, a small number, or any number of that width.
inline std::uint64_t telling(ByteReader& in, unsigned bits = 64) {
  const std::uint64_t greatest = bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
  const unsigned kind = in.u8();
  switch (kind % 9) {
    case 0: return 0;
    case 1: return 1;
    case 2: return greatest;
    case 3: return std::uint64_t{1} << (in.u8() % bits);
    case 4: return ((std::uint64_t{1} << (in.u8() % bits)) + 1) & greatest;
    case 5: return (std::uint64_t{1} << (in.u8() % bits)) - 1;
    case 6: return in.u32() & greatest;
    case 7: return in.u64() & greatest;
    default: return in.u8();
  }
}
inline std::uint32_t telling32(ByteReader& in) { return static_cast<std::uint32_t>(telling(in, 32)); }

/// A rate as in a host's, a file's or a user's text: any two numbers, or a fraction that is allowed or nearly so, with
/// both terms multiplied by a number that leaves few or no bits free.
struct DrawnRate {
  std::uint32_t numerator = 0, denominator = 0;
};
inline DrawnRate drawn_terms(ByteReader& in) {
  const unsigned kind = in.u8();
  if (kind % 4 == 0) {
    const std::uint32_t numerator = telling32(in);
    return {numerator, telling32(in)};
  }
  const std::uint32_t above = kind % 4 == 1 ? 30'000U : 1U + in.u8(), below = kind % 4 == 1 ? 1001U : 1U + kind / 4;
  const std::uint32_t most = ~std::uint32_t{0} / std::max(above, below);
  const std::uint32_t factor = std::clamp(telling32(in), 1U, most);
  return {above * factor, below * factor};
}

/// A text of up to 255 input bytes.
inline std::string text(ByteReader& in) {
  const auto bytes = in.bytes(std::min<std::size_t>(in.u8(), in.left()));
  return {bytes.begin(), bytes.end()};
}

}  // namespace nodal::fuzz
