// Counts what this program has on the heap, by taking the place of malloc().
#pragma once

#include <cstddef>
#include <functional>

namespace nodal::limits {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kCountsHeap = false;  // a sanitizer has a malloc() of its own
#else
inline constexpr bool kCountsHeap = true;
#endif

/// The most bytes that were on the heap at once while `work` ran, beside those that were there when it began: blocks
/// with their headers, also those of libraries in C.
///
/// Threading: no other thread may allocate meanwhile.
std::size_t peak_of(const std::function<void()>& work);

}  // namespace nodal::limits
