#pragma once

#include <cstdint>
#include <numeric>
#include <vector>

namespace nodal::hal::cable {

using Bytes = std::vector<std::uint8_t>;

/// 1, 2, 3, ... 255, 0, 1, ...
inline Bytes numbered(std::size_t n) {
  Bytes bytes(n);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{1});
  return bytes;
}

}  // namespace nodal::hal::cable
