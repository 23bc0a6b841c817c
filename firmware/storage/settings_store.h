// The stage that stores the settings: reads them from the disk when the rig starts, writes them when they change.
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

/// The settings on the disk when the rig started.
struct SettingsReport {
  std::optional<std::string> file;  ///< no value: not read yet; "": no file, or it must not be used; else its bytes
  std::string problem;              ///< why an existing file is not used
};

/// Handles the settings as bytes; operate/settings.h parses them.
///
/// Threading: step() is thread-bound to the keeper's thread, the one that may wait for the disk; writes() and answers()
///   are SPSC rings with control, snapshot() is read by control.
/// Ownership: the disk outlives it.
/// Errors: a write's error is in its answer; that of the read at start is in the report.
class SettingsStore {
 public:
  explicit SettingsStore(hal::DiskPort& disk);

  /// True when it did something.
  bool step();
  /// The rig ends on request: this start does not count as failed.
  void close() { starts_.succeeded(); }

  /// New contents of the file.
  SpscRing<std::string>& writes() { return writes_; }
  /// The result of each write, in order.
  SpscRing<Status>& answers() { return answers_; }
  /// The rig has run for RigWatch::kStableAfter without a fault: this start does not count as failed. Any thread.
  void note_stable_run() { stable_.store(true, std::memory_order_relaxed); }
  Snapshot<SettingsReport>& snapshot() { return snapshot_; }

 private:
  void read();

  hal::DiskPort& disk_;
  StartCount starts_;
  SpscRing<std::string> writes_;
  SpscRing<Status> answers_;
  Snapshot<SettingsReport> snapshot_;
  std::atomic<bool> stable_{false};
  bool read_ = false;
};

/// File name, in the root of the store's disk.
inline const std::string kSettingsFile = "settings";
inline constexpr std::uint64_t kMaxSettingsBytes = 64 * 1024;

}  // namespace nodal::firmware
