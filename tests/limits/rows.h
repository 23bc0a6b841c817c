// Compares what rows of protocol/LIMITS.md need with the figures on that page.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace nodal::limits {

/// How the memory of a row is found.
enum class Means : std::uint8_t {
  kHeap,       ///< `needs` fills the row to its limit and counts the heap
  kSizes,      ///< `needs` is a product of constants and sizes of types
  kAddresses,  ///< `needs` is the limit of a process's addresses
};

struct Row {
  std::string what;  ///< its first cell on the page
  Means means = Means::kHeap;
  std::function<std::uint64_t()> needs;  ///< bytes
};

/// Fails for a row whose figure is less than it needs, or more than twice that (or a KiB, if that is more), and for one
/// that names other means. A limit of addresses and a number of pictures are exactly what the page says. Rows of the
/// heap are left out where a sanitizer is in the way.
void check(const std::vector<Row>& rows);

}  // namespace nodal::limits
