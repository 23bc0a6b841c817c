// With which seams sets are blended, for takes.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "protocol/base/spsc_ring.h"
#include "stitch/sets/blend_plan.h"

namespace nodal::firmware {

/// From a set on, sets are blended with other seams.
struct SeamChange {
  std::uint64_t first_set = 0;
  sets::SeamLabels labels;  ///< null: the calibration's own
};

/// From the blend to the takes' stage. Nothing is logged before open().
///
/// Threading: changes() is an SPSC ring from the blend to the takes' stage; open() before the first set; begin() is the
///   blend's; sets_begun() any thread.
/// Ownership: owns what it logs. Errors: none.
class SeamLog {
 public:
  /// Seams stay where they are while it is full.
  SpscRing<SeamChange>& changes() { return changes_; }
  void open() { open_ = true; }
  bool is_open() const { return open_; }

  /// The set's seams have been logged.
  void begin(std::uint64_t set) { sets_begun_.store(set + 1, std::memory_order_release); }
  /// Every set with a lower number was begun, skipped or missed, and its seams have been logged.
  std::uint64_t sets_begun() const { return sets_begun_.load(std::memory_order_acquire); }

  static constexpr std::size_t kChangesWaiting = 64;

 private:
  SpscRing<SeamChange> changes_{kChangesWaiting};
  bool open_ = false;
  std::atomic<std::uint64_t> sets_begun_{0};
};

}  // namespace nodal::firmware
