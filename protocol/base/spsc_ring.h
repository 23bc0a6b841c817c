#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "protocol/base/result.h"

namespace nodal {

/// A FIFO from exactly one thread to exactly one other, without a lock: neither thread ever waits for the other, and
/// nothing is allocated after construction.
///
/// Threading: push(), full() by one thread; pop(), empty() by one other thread.
/// Ownership: owns its values; pop() resets the slot to T{}, so that a buffer is released at once.
/// Errors: push() returns false when full, pop() returns nothing when empty.
template <class T>
class SpscRing {
 public:
  explicit SpscRing(std::size_t capacity) : places_(capacity) { NODAL_ASSERT(capacity > 0); }
  SpscRing(const SpscRing&) = delete;
  SpscRing& operator=(const SpscRing&) = delete;

  /// Returns false and leaves `value` unchanged when full.
  bool push(T&& value) {
    const std::uint64_t written = written_.load(std::memory_order_relaxed);
    if (written - read_.load(std::memory_order_acquire) == places_.size()) return false;
    places_[written % places_.size()] = std::move(value);
    written_.store(written + 1, std::memory_order_release);
    return true;
  }
  bool full() const {
    return written_.load(std::memory_order_relaxed) - read_.load(std::memory_order_acquire) == places_.size();
  }

  std::optional<T> pop() {
    const std::uint64_t read = read_.load(std::memory_order_relaxed);
    if (written_.load(std::memory_order_acquire) == read) return std::nullopt;
    std::optional<T> value(std::exchange(places_[read % places_.size()], T{}));
    read_.store(read + 1, std::memory_order_release);
    return value;
  }
  bool empty() const { return written_.load(std::memory_order_acquire) == read_.load(std::memory_order_relaxed); }

  std::size_t capacity() const { return places_.size(); }

 private:
  // One cache line each: no false sharing between the two threads.
  static constexpr std::size_t kCacheLine = 64;

  std::vector<T> places_;
  alignas(kCacheLine) std::atomic<std::uint64_t> written_{0};  // never wraps: 2^64 pushes are not reached
  alignas(kCacheLine) std::atomic<std::uint64_t> read_{0};
};

}  // namespace nodal
