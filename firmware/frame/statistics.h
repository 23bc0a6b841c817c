#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/base/units.h"

namespace nodal::firmware {

/// The rate in 1/1000 frames a second.
constexpr std::uint32_t millihertz(FrameRate rate) {
  return static_cast<std::uint32_t>(std::uint64_t{rate.numerator} * 1000 / rate.denominator);
}

/// The median; the upper one when the number of values is even. Reorders `values`, which must not be empty.
template <typename T>
T median(std::span<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The median of the processing times of a stage, over the newest 64.
///
/// Threading: add() by one thread at a time, median() by any.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class RecentTimes {
 public:
  void add(Duration took) {
    const std::uint64_t n = count_.load(std::memory_order_relaxed);
    times_[n % kKept].store(took.ns(), std::memory_order_relaxed);
    count_.store(n + 1, std::memory_order_relaxed);
  }
  /// 0 before the first add().
  Duration median() const {
    const std::size_t kept = std::min<std::size_t>(count_.load(std::memory_order_relaxed), kKept);
    if (kept == 0) return Duration();
    std::array<std::int64_t, kKept> sorted{};
    for (std::size_t i = 0; i < kept; ++i) sorted[i] = times_[i].load(std::memory_order_relaxed);
    return Duration::nanoseconds(firmware::median(std::span(sorted).first(kept)));
  }

 private:
  static constexpr std::size_t kKept = 64;
  std::array<std::atomic<std::int64_t>, kKept> times_{};
  std::atomic<std::uint64_t> count_{0};
};

/// The rate of an event over the last three seconds.
///
/// Threading: thread-bound.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class RecentRate {
 public:
  /// `total` is the number of events until `now`. Call it at least four times a second.
  void observe(std::uint64_t total, Instant now) {
    if (count_ > 0 && now - at_[(count_ - 1) % kKept] < kEvery) return;
    at_[count_ % kKept] = now;
    total_[count_ % kKept] = total;
    ++count_;
  }
  /// Events per 1000 seconds; 0 before the second observation.
  std::uint32_t millihertz() const {
    if (count_ < 2) return 0;
    const std::size_t newest = (count_ - 1) % kKept;
    const std::size_t oldest = count_ > kKept ? count_ % kKept : 0;
    const std::int64_t span = (at_[newest] - at_[oldest]).ns();
    if (span <= 0) return 0;
    const auto events = static_cast<std::int64_t>(total_[newest] - total_[oldest]);
    return static_cast<std::uint32_t>(events * 1'000'000 / (span / 1'000'000));
  }

 private:
  static constexpr std::size_t kKept = 13;  ///< 12 intervals of kEvery: three seconds
  static constexpr Duration kEvery = Duration::milliseconds(250);
  std::array<Instant, kKept> at_{};
  std::array<std::uint64_t, kKept> total_{};
  std::size_t count_ = 0;
};

}  // namespace nodal::firmware
