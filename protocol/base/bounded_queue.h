#pragma once

#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "protocol/base/result.h"

namespace nodal {

/// A FIFO of fixed capacity, allocated once. push() returns false when the queue is full; the caller decides which
/// value to drop, and counts it.
///
/// Threading: thread-bound; between two threads use SpscRing.
/// Ownership: owns its values. T must be default-constructible: pop() resets the slot to T{}, so that the queue keeps
///   nothing alive.
/// Errors: push() returns false when full, pop() returns nothing when empty.
template <class T>
class BoundedQueue {
 public:
  explicit BoundedQueue(std::size_t capacity) : places_(capacity) { NODAL_ASSERT(capacity > 0); }

  /// Returns false and leaves `value` unchanged when full.
  bool push(T&& value) {
    if (full()) return false;
    places_[(first_ + size_) % places_.size()] = std::move(value);
    ++size_;
    return true;
  }
  bool push(const T& value) {
    if (full()) return false;
    return push(T(value));
  }

  std::optional<T> pop() {
    if (empty()) return std::nullopt;
    std::optional<T> value(std::exchange(places_[first_], T{}));
    first_ = (first_ + 1) % places_.size();
    --size_;
    return value;
  }

  /// The oldest value; the queue must not be empty.
  T& front() {
    NODAL_ASSERT(!empty());
    return places_[first_];
  }
  const T& front() const {
    NODAL_ASSERT(!empty());
    return places_[first_];
  }

  void clear() {
    while (pop()) {}
  }

  bool empty() const { return size_ == 0; }
  bool full() const { return size_ == places_.size(); }
  std::size_t size() const { return size_; }
  std::size_t capacity() const { return places_.size(); }

 private:
  std::vector<T> places_;
  std::size_t first_ = 0;
  std::size_t size_ = 0;
};

}  // namespace nodal
