// Pooled values that several readers, on any threads, share without a copy or a lock.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "protocol/base/result.h"

namespace nodal {

template <class T>
class LoanPool;

/// One holder's reference to a pool's value. Copies are further holders; when the last one is destroyed, the pool may
/// lend the value again. A sole holder may write; several holders may only read.
///
/// Threading: a Loan is thread-bound, and copies of it may live on other threads.
/// Ownership: the pool owns the value and outlives every Loan.
/// Errors: none.
template <class T>
class Loan {
 public:
  Loan() = default;
  Loan(const Loan& other) : place_(other.place_) {
    if (place_) place_->holders.fetch_add(1, std::memory_order_relaxed);
  }
  Loan(Loan&& other) noexcept : place_(std::exchange(other.place_, nullptr)) {}
  Loan& operator=(Loan other) noexcept {
    std::swap(place_, other.place_);
    return *this;
  }
  ~Loan() {
    if (place_) place_->holders.fetch_sub(1, std::memory_order_release);
  }

  explicit operator bool() const { return place_ != nullptr; }
  const T& operator*() const { return place_->value; }
  const T* operator->() const { return &place_->value; }
  /// Only for a sole holder.
  T& edit() const {
    NODAL_ASSERT(place_->holders.load(std::memory_order_acquire) == 1);
    return place_->value;
  }
  friend bool operator==(const Loan& a, const Loan& b) { return a.place_ == b.place_; }

 private:
  friend class LoanPool<T>;
  struct Place {
    std::atomic<std::uint32_t> holders{0};
    bool lent = false;  ///< taken, and not yet collected by the owner
    T value{};
  };
  explicit Loan(Place& place) : place_(&place) {}

  Place* place_ = nullptr;
};

/// At most `most` values, created when first needed and then kept, so that allocations end at the peak of use.
///
/// Threading: thread-bound to the owner, or called by one thread at a time.
/// Ownership: owns the values.
/// Errors: take() gives an empty Loan when everything is lent.
template <class T>
class LoanPool {
 public:
  /// take() and collect() call `returned` for each value that its last holder has released.
  explicit LoanPool(std::size_t most, std::function<void(T&)> returned = {})
      : most_(most), returned_(std::move(returned)) {
    places_.reserve(most);
  }
  LoanPool(const LoanPool&) = delete;
  LoanPool& operator=(const LoanPool&) = delete;
  ~LoanPool() {
    for (const auto& place : places_) NODAL_ASSERT(place->holders.load(std::memory_order_acquire) == 0);
  }

  /// Lends a value; its content is what its last holder left.
  Loan<T> take() {
    collect();
    for (const auto& place : places_) {
      if (!place->lent) return lend(*place);
    }
    if (places_.size() == most_) return {};
    places_.push_back(std::make_unique<typename Loan<T>::Place>());
    return lend(*places_.back());
  }
  /// Takes back the values that have no holder. Returns whether there was one.
  bool collect() {
    bool any = false;
    for (const auto& place : places_) {
      if (!place->lent || place->holders.load(std::memory_order_acquire) != 0) continue;
      place->lent = false;
      if (returned_) returned_(place->value);
      any = true;
    }
    return any;
  }
  /// Number of values that were taken and not yet collected.
  std::size_t lent() const {
    std::size_t count = 0;
    for (const auto& place : places_) count += place->lent;
    return count;
  }
  std::size_t most() const { return most_; }

 private:
  static Loan<T> lend(typename Loan<T>::Place& place) {
    place.lent = true;
    place.holders.store(1, std::memory_order_relaxed);
    return Loan<T>(place);
  }

  const std::size_t most_;
  const std::function<void(T&)> returned_;
  std::vector<std::unique_ptr<typename Loan<T>::Place>> places_;
};

}  // namespace nodal
