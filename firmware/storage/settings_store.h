// The stage that keeps settings on the disk: reads them when the rig starts, writes them when they change.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

#include "firmware/frame/snapshot.h"
#include "firmware/storage/start_count.h"
#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/spsc_ring.h"

namespace nodal::firmware {

/// What the disk held when the rig started.
struct SettingsReport {
  std::optional<std::string> file;  ///< once it was read: its bytes; empty: there is none, or it must not be used
  std::string problem;              ///< why it is not used
};

/// Settings as bytes; what they mean is operate/settings.h's.
///
/// Threading: step() is thread-bound to the keeper's thread, the one that may wait for the disk; writes() and answers() are
///   SPSC rings with control, snapshot() is read by control.
/// Ownership: the disk outlives it.
/// Errors: of a write, in its answer; of the read at start, in the report.
class SettingsStore {
 public:
  explicit SettingsStore(hal::DiskPort& disk);

  /// True when it did something.
  bool step();
  /// The rig ends because it was asked to: this start was no failure.
  void close() { starts_.succeeded(); }

  /// What the file is to be.
  SpscRing<std::string>& writes() { return writes_; }
  /// How each of them ended, in their order.
  SpscRing<Status>& answers() { return answers_; }
  /// The rig has run well for a while: this start was no failure. Any thread.
  void note_that_it_runs_well() { runs_well_.store(true, std::memory_order_relaxed); }
  Snapshot<SettingsReport>& snapshot() { return snapshot_; }

 private:
  void read();

  hal::DiskPort& disk_;
  StartCount starts_;
  SpscRing<std::string> writes_;
  SpscRing<Status> answers_;
  Snapshot<SettingsReport> snapshot_;
  std::atomic<bool> runs_well_{false};
  bool read_ = false;
};

/// In the root of the store's disk.
inline const std::string kSettingsFile = "settings";
inline constexpr std::uint64_t kMaxSettingsBytes = 64 * 1024;

}  // namespace nodal::firmware
