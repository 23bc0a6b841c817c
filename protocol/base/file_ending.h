// Endings of file names, in any case: cameras write .JPG.
#pragma once

#include <algorithm>
#include <string_view>

namespace nodal {

/// `ending` with its dot, in lower-case ASCII.
constexpr bool has_ending(std::string_view name, std::string_view ending) {
  if (name.size() < ending.size()) return false;
  return std::equal(ending.begin(), ending.end(), name.end() - static_cast<std::ptrdiff_t>(ending.size()),
                    [](char wanted, char c) { return wanted == (c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c); });
}

}  // namespace nodal
