// Hands out the pieces of one round of work after the other to any number of threads, without a lock.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "protocol/base/result.h"

namespace nodal::firmware {

/// One thread starts a round when all bands of the one before are done; any thread takes bands.
///
/// Threading: take() and done() are thread-safe, also while a round is started; the other calls are for one thread at a
///   time.
/// Errors: none. Allocates nothing.
class BandTickets {
 public:
  /// Bands of the largest round.
  static constexpr std::uint64_t kAllBands = (std::uint64_t{1} << 16) - 1;

  /// A round of bands 0 .. `bands` - 1. What the calling thread wrote before is visible to those that take them.
  void start(std::uint64_t bands) {
    NODAL_ASSERT(bands <= kAllBands);
    done_.store(0, std::memory_order_relaxed);
    next_.store((++round_ << 2 * kBandBits) | (bands << kBandBits), std::memory_order_release);
  }
  /// A band that no other thread has; nothing when all are taken. Call done() after it.
  std::optional<std::uint64_t> take() {
    std::uint64_t ticket = next_.load(std::memory_order_acquire);
    do {
      if (band_of(ticket) >= bands_of(ticket)) return std::nullopt;
    } while (!next_.compare_exchange_weak(ticket, ticket + 1, std::memory_order_acq_rel, std::memory_order_acquire));
    return band_of(ticket);
  }
  void done() { done_.fetch_add(1, std::memory_order_acq_rel); }
  /// All bands of the round are done; what their threads wrote is visible.
  bool all_done() const {
    return done_.load(std::memory_order_acquire) >= bands_of(next_.load(std::memory_order_relaxed));
  }

 private:
  // Packed in one 64-bit value: {round number, bands in the round, next band}. One compare-and-swap covers all three.
  // With the count in a separate variable, a thread could compare a band number of the last round with the count of the
  // next round and take a band that does not exist yet.
  static constexpr int kBandBits = 16;
  static std::uint64_t band_of(std::uint64_t ticket) { return ticket & kAllBands; }
  static std::uint64_t bands_of(std::uint64_t ticket) { return (ticket >> kBandBits) & kAllBands; }

  std::uint64_t round_ = 0;
  std::atomic<std::uint64_t> next_{0};
  std::atomic<std::uint64_t> done_{0};
};

}  // namespace nodal::firmware
