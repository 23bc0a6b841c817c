#include "firmware/storage/settings_store.h"

#include <utility>

#include "firmware/storage/durable_file.h"

namespace nodal::firmware {
namespace {

constexpr std::size_t kWrites = 2;  // entries of the rings; SettingsWriter has at most one write under way

}  // namespace

SettingsStore::SettingsStore(hal::DiskPort& disk) : disk_(disk), starts_(disk), writes_(kWrites), answers_(kWrites) {}

bool SettingsStore::step() {
  if (!read_) {
    read_ = true;
    read();
    return true;
  }
  if (stable_.load(std::memory_order_relaxed)) starts_.succeeded();
  if (answers_.full()) return false;
  const auto file = writes_.pop();
  if (!file) return false;
  Status written = write_durably(disk_, "", kSettingsFile, *file);
  if (!written) written = fail(written.error().in("settings"));
  const bool pushed = answers_.push(std::move(written));
  NODAL_ASSERT(pushed);
  return true;
}

void SettingsStore::read() {
  SettingsReport report;
  const auto file = disk_.read(kSettingsFile, kMaxSettingsBytes);
  report.file = file ? std::string(file->begin(), file->end()) : std::string();
  if (!report.file->empty()) {
    if (auto put_aside = starts_.begin()) {
      report.file->clear();
      report.problem = std::move(*put_aside);
    }
  }
  if (!file && file.error().code != Errc::kNotFound) {
    report.problem =
        file.error().in("could not read the stored settings, the rig starts with those of rig.toml").message;
  }
  snapshot_.publish(report);
}

}  // namespace nodal::firmware
