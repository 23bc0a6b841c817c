#include "firmware/storage/start_count.h"

#include <fmt/format.h>

#include "firmware/storage/durable_file.h"
#include "firmware/storage/settings_store.h"

namespace nodal::firmware {

/// The file holds one digit; any other contents count as 0.
int StartCount::failed_before() const {
  const auto file = disk_.read(kStartsFile, 1);
  if (!file || file->size() != 1 || file->front() < '0' || file->front() > '9') return 0;
  return file->front() - '0';
}

std::optional<std::string> StartCount::begin() {
  const int failed = failed_before();
  if (failed < kMaxFailed) {
    begun_ = true;
    (void)write_durably(disk_, "", kStartsFile, std::to_string(failed + 1));
    return std::nullopt;
  }
  const std::string reason = fmt::format(
      "the rig failed {} times with the stored settings; it starts with those of rig.toml; the stored ones are ",
      failed);
  Status moved = disk_.rename(kSettingsFile, kSettingsAsideFile);
  if (moved) moved = disk_.remove(kStartsFile);
  if (moved) moved = disk_.sync_folder("");
  return reason + (moved ? "kept in the store as " + kSettingsAsideFile : "ignored: " + moved.error().message);
}

void StartCount::succeeded() {
  if (!begun_) return;
  begun_ = false;
  if (disk_.remove(kStartsFile)) (void)disk_.sync_folder("");
}

}  // namespace nodal::firmware
