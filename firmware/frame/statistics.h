#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/base/frame_time.h"
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

/// The rate of an event over the last three seconds; or, when these have fewer than kFew events, over the last kEvents
/// of them, measured from event to event, so that a rate of one in 1000 s is exact as well.
///
/// Threading: thread-bound.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class RecentRate {
 public:
  /// `total` is the number of events until `now`. Call it at least four times a second.
  void observe(std::uint64_t total, Instant now) {
    now_ = now;
    if (events_.count == 0 || total != events_.newest().total) events_.add(now, total);
    if (window_.count == 0 || now - window_.newest().at >= kEvery) window_.add(now, total);
  }
  /// Events per 1000 seconds; 0 before the second event. Falls when events no longer come.
  std::uint32_t millihertz() const {
    if (window_.count > 1 && window_.events() >= kFew) return per_1000_s(window_.events(), window_.span());
    if (events_.count < 2 || events_.events() == 0) return 0;
    const Duration apart = events_.span() / events_.events();
    const Duration since = now_ - events_.newest().at;
    if (since > kForgotten.at(apart)) return 0;
    return per_1000_s(events_.events(), events_.span() + (since > kLate.at(apart) ? since : Duration()));
  }

 private:
  struct Moment {
    Instant at;
    std::uint64_t total = 0;
  };
  template <std::size_t kKept>
  struct Ring {
    std::array<Moment, kKept> moments{};
    std::size_t count = 0;

    void add(Instant at, std::uint64_t total) { moments[count++ % kKept] = {at, total}; }
    const Moment& newest() const { return moments[(count - 1) % kKept]; }
    const Moment& oldest() const { return moments[count > kKept ? count % kKept : 0]; }
    std::int64_t events() const { return static_cast<std::int64_t>(newest().total - oldest().total); }
    Duration span() const { return newest().at - oldest().at; }
  };
  static std::uint32_t per_1000_s(std::int64_t events, Duration span) {
    return span.ms() <= 0 ? 0 : static_cast<std::uint32_t>(events * 1'000'000 / span.ms());
  }

  static constexpr std::size_t kEvents = 32;
  static constexpr std::int64_t kFew = 40;
  static constexpr Duration kEvery = Duration::milliseconds(250);
  static constexpr FrameTime kLate{Duration::milliseconds(500), 2};
  static constexpr FrameTime kForgotten{Duration::seconds(3), 4};
  Ring<13> window_;  ///< 12 intervals of kEvery: three seconds
  Ring<kEvents> events_;
  Instant now_;
};

}  // namespace nodal::firmware
