// Settings under which the rig does not run must not be made at every start for ever.
#pragma once

#include <optional>
#include <string>

#include "hal/disk.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// Counts, on the disk, the starts that used remembered settings and did not last: neither ran well for a while nor were
/// asked to end. After kMostFailed of them in a row the settings are put aside under another name, one file at most,
/// and the rig starts as rig.toml says.
///
/// Threading: thread-bound to its SettingsStore. Calls take as long as the disk does.
/// Ownership: the disk outlives it.
/// Errors: a disk that fails costs the count, not the start.
class StartCount {
 public:
  static constexpr int kMostFailed = 2;

  explicit StartCount(hal::DiskPort& disk) : disk_(disk) {}
  /// Settings are there and about to be used. A sentence when they must not be: they were put aside just now.
  std::optional<std::string> begin();
  /// The rig has run well for a while, or ends because it was asked to.
  void succeeded();

 private:
  int failed_before() const;

  hal::DiskPort& disk_;
  bool begun_ = false;
};

/// In the root of the store's disk.
inline const std::string kStartsFile = "settings-starts";
inline const std::string kSettingsAsideFile = "settings-aside";

}  // namespace nodal::firmware
