// Bytes that begin with a line of the processor's caches.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

namespace nodal::firmware {

/// Memory that begins at a multiple of 64 bytes, a cache line of every processor nodald runs on.
template <class T>
struct LineAllocator {
  using value_type = T;
  static constexpr std::align_val_t kLine{64};

  LineAllocator() = default;
  template <class Other>
  explicit LineAllocator(const LineAllocator<Other>&) {}
  T* allocate(std::size_t count) { return static_cast<T*>(::operator new(count * sizeof(T), kLine)); }
  void deallocate(T* block, std::size_t) { ::operator delete(block, kLine); }
  bool operator==(const LineAllocator&) const = default;
};

/// The memory of pixels that the blend writes: it writes whole cache lines past the caches only where a row begins with
/// one (r8: 17.7 ms a raymap, else 21.2).
using LineVector = std::vector<std::uint8_t, LineAllocator<std::uint8_t>>;

}  // namespace nodal::firmware
