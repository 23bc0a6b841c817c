// Where readers of frame sets and raymaps attach: each has a bounded queue and a count of what it missed.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string_view>

#include "protocol/base/spsc_ring.h"

namespace nodal::firmware {

enum class OutletPolicy : std::uint8_t {
  kLossless,  ///< in order; what comes while the queue is full is missed
  kLatest,    ///< only the newest of what waits is read; the older ones are missed
};

/// What a reader asks for when it registers. A reader of frame sets never waits for a disk, a network or a host: a set holds
/// buffers of the heads, and a head that was unplugged can be opened again only when all of its buffers are back. What may
/// wait reads raymaps, or copies. The numbers bound how many sets or raymaps a reader can hold at once, from which the
/// number of buffers is computed (kFramesAHead).
struct OutletSpec {
  std::string_view name;  ///< for status, of static storage
  OutletPolicy policy = OutletPolicy::kLatest;
  std::size_t waiting = 1;  ///< in the queue, at most
  std::size_t reading = 1;  ///< taken and not given back, at most; the reader keeps to it
};

/// Sets or raymaps that a reader holds at the same time, at most.
constexpr std::size_t held_at_most(const OutletSpec& spec) { return spec.waiting + spec.reading; }

/// What an outlet missed, by reason.
struct OutletLosses {
  std::uint64_t full = 0;      ///< its queue was full
  std::uint64_t replaced = 0;  ///< a newer one waited behind it
};

/// One reader's end of a source. No outlet can slow the source or another outlet down.
///
/// Threading: offer() by the source's thread; take(), drop_waiting() by the reader's; the rest by any.
/// Ownership: owns what waits.
/// Errors: none; what is missed is counted.
template <class T>
class Outlet {
 public:
  Outlet(const OutletSpec& spec, bool open) : spec_(spec), queue_(spec.waiting), open_(open) {}

  /// Gives the reader its copy. A closed outlet is offered nothing and misses nothing.
  void offer(const T& item) {
    if (!open_.load(std::memory_order_relaxed)) return;
    T copy = item;
    if (!queue_.push(std::move(copy))) full_.fetch_add(1, std::memory_order_relaxed);
  }
  std::optional<T> take() {
    std::optional<T> taken = queue_.pop();
    while (spec_.policy == OutletPolicy::kLatest && !queue_.empty()) {
      taken = queue_.pop();
      replaced_.fetch_add(1, std::memory_order_relaxed);
    }
    return taken;
  }
  /// Gives back what waits, uncounted: of before the outlet was opened again.
  void drop_waiting() {
    while (queue_.pop()) {}
  }
  void set_open(bool open) { open_.store(open, std::memory_order_relaxed); }

  bool full() const { return queue_.full(); }
  bool empty() const { return queue_.empty(); }
  const OutletSpec& spec() const { return spec_; }
  OutletLosses losses() const {
    return {full_.load(std::memory_order_relaxed), replaced_.load(std::memory_order_relaxed)};
  }

 private:
  const OutletSpec spec_;
  SpscRing<T> queue_;
  std::atomic<bool> open_;
  std::atomic<std::uint64_t> full_{0};
  std::atomic<std::uint64_t> replaced_{0};
};

/// All readers of one source. They register before the source begins, and stay.
template <class T>
class Outlets {
 public:
  Outlet<T>& add(const OutletSpec& spec, bool open = true) { return outlets_.emplace_back(spec, open); }
  void offer(const T& item) {
    for (Outlet<T>& outlet : outlets_) outlet.offer(item);
  }
  /// What all of them can hold at once.
  std::size_t held_at_most() const {
    std::size_t sum = 0;
    for (const Outlet<T>& outlet : outlets_) sum += nodal::firmware::held_at_most(outlet.spec());
    return sum;
  }
  auto begin() { return outlets_.begin(); }
  auto end() { return outlets_.end(); }

 private:
  std::deque<Outlet<T>> outlets_;  // they never move
};

}  // namespace nodal::firmware
