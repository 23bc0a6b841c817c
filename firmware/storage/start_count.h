// Counts failed starts, so that stored settings with which the rig fails are not restored at every start.
#pragma once

#include <optional>
#include <string>

#include "hal/disk.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// Counts on the disk the failed starts with stored settings: runs that ended without a request, before
/// RigWatch::kStableAfter. After kMaxFailed of them in a row it renames the settings file to kSettingsAsideFile (an
/// older one is overwritten), and the rig starts with the settings of rig.toml.
///
/// Threading: thread-bound to its SettingsStore. Calls take as long as the disk does.
/// Ownership: the disk outlives it.
/// Errors: none; when the disk fails, the count is lost and the rig starts anyway.
class StartCount {
 public:
  static constexpr int kMaxFailed = 2;

  explicit StartCount(hal::DiskPort& disk) : disk_(disk) {}
  /// Call before stored settings are restored. Returns a sentence when they must not be: it has just moved them aside.
  std::optional<std::string> begin();
  /// The rig has run for RigWatch::kStableAfter, or ends on request: resets the count.
  void succeeded();

 private:
  int failed_before() const;

  hal::DiskPort& disk_;
  bool begun_ = false;
};

/// File names, in the root of the store's disk.
inline const std::string kStartsFile = "settings-starts";
inline const std::string kSettingsAsideFile = "settings-aside";

}  // namespace nodal::firmware
