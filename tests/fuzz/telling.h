// Values that find faults more often than random ones, drawn from a fuzzer's input.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include "protocol/base/bytes.h"

namespace nodal::fuzz {

/// 0, 1, the greatest of `bits` bits, a power of two, its two neighbours, a small number, or any number of that width.
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

/// A text of up to 255 of the input's bytes.
inline std::string text(ByteReader& in) {
  const auto bytes = in.bytes(std::min<std::size_t>(in.u8(), in.left()));
  return {bytes.begin(), bytes.end()};
}

}  // namespace nodal::fuzz
