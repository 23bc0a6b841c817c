// Restores the settings of the last run, and stores each that changes.
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "firmware/capture/capture.h"
#include "firmware/operate/news.h"
#include "firmware/operate/settings.h"
#include "firmware/operate/settings_writer.h"
#include "firmware/storage/settings_store.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// Threading: thread-bound to control.
/// Ownership: the store outlives it.
/// Errors: none; problem() is the reason why settings will be lost at the next start.
class SettingsKeeper {
 public:
  /// `rig`: rig.toml's hash. Settings of another rig.toml are not restored.
  SettingsKeeper(SettingsStore& store, const Sha256& rig) : store_(store), rig_(rig) {}

  /// Takes the stored settings when the store has read them.
  void read(News& news);
  /// The next stored setting to restore, or null.
  const CaptureCommand* next_to_restore() const;
  void restored() { restoring_->pop_front(); }

  /// A setting was changed.
  void remember(const CaptureCommand& change);
  /// Takes the results of writes.
  void take_answers(News& news);
  /// Writes what has changed, when it is time to.
  void write(Instant now);
  /// Whether a reply about a setting should wait for the result of the current write.
  bool worth_waiting(Instant now) const { return writer_.worth_waiting(now); }
  const std::string& problem() const { return writer_.problem(); }

 private:
  SettingsStore& store_;
  const Sha256 rig_;
  Settings settings_;
  std::optional<std::deque<CaptureCommand>> restoring_;  ///< stored settings still to restore; empty: not read yet
  SettingsWriter writer_;
};

}  // namespace nodal::firmware
