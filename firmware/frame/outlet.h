// Readers of frame sets and raymaps attach to outlets. Each outlet has a bounded queue and counts what its reader
// missed.
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
  kLossless,  ///< items are read in order; an item offered while the queue is full is missed
  kLatest,    ///< only the newest queued item is read; the older ones are missed
};

/// What a reader specifies when it registers. A reader of frame sets never waits for a disk, a network or a host: a set
/// holds buffers of the heads, and an unplugged head can be opened again only after all of its buffers were released. A
/// reader that may wait reads raymaps, or copies. The numbers bound how many sets or raymaps a reader can hold at once;
/// kFramesAHead computes the number of buffers from them.
struct OutletSpec {
  std::string_view name;  ///< shown in status; must have static storage duration
  OutletPolicy policy = OutletPolicy::kLatest;
  std::size_t waiting = 1;  ///< capacity of the queue
  std::size_t reading = 1;  ///< most items taken and not yet released; the reader must not exceed it
};

/// The most sets or raymaps that a reader can hold at the same time.
constexpr std::size_t held_at_most(const OutletSpec& spec) { return spec.waiting + spec.reading; }

/// How many items an outlet missed, by reason.
struct OutletLosses {
  std::uint64_t full = 0;      ///< the queue was full
  std::uint64_t replaced = 0;  ///< kLatest: a newer item was in the queue
};

/// The queue from a source to one reader. No outlet can slow down the source or another outlet.
///
/// Threading: offer() by the source's thread; take(), drop_waiting() by the reader's; the rest by any.
/// Ownership: owns the queued items.
/// Errors: none; missed items are counted.
template <class T>
class Outlet {
 public:
  Outlet(const OutletSpec& spec, bool open) : spec_(spec), queue_(spec.waiting), open_(open) {}

  /// Queues a copy for the reader. Does nothing while the outlet is closed, and then counts nothing as missed.
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
  /// Releases all queued items without counting them as missed: they are from before the outlet was reopened.
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

/// All readers of one source. They register before the source starts and are never removed.
template <class T>
class Outlets {
 public:
  Outlet<T>& add(const OutletSpec& spec, bool open = true) { return outlets_.emplace_back(spec, open); }
  void offer(const T& item) {
    for (Outlet<T>& outlet : outlets_) outlet.offer(item);
  }
  /// The most items that all of them together can hold at once.
  std::size_t held_at_most() const {
    std::size_t sum = 0;
    for (const Outlet<T>& outlet : outlets_) sum += nodal::firmware::held_at_most(outlet.spec());
    return sum;
  }
  auto begin() { return outlets_.begin(); }
  auto end() { return outlets_.end(); }

 private:
  std::deque<Outlet<T>> outlets_;  // a deque, because readers keep references to elements
};

}  // namespace nodal::firmware
