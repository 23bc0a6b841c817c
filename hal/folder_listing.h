// The entries of one folder, up to a limit, for every implementation of DiskPort.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "hal/disk.h"

namespace nodal::hal {

/// Threading: thread-bound.
/// Ownership: owns what was added.
/// Errors: kTooLarge, naming the folder, for an entry more than kMaxEntries, or names of more than kMaxNamesBytes
/// together.
class FolderListing {
 public:
  static constexpr std::size_t kMaxEntries = 250'000;  ///< more than the longest take has files
  static constexpr std::size_t kMaxNamesBytes = std::size_t{16} << 20;

  /// `folder`: its name in messages.
  explicit FolderListing(std::string folder) : folder_(std::move(folder)) {}

  Status add(FolderEntry entry) {
    names_bytes_ += entry.name.size();
    if (entries_.size() >= kMaxEntries || names_bytes_ > kMaxNamesBytes) {
      return fail(
          Errc::kTooLarge,
          fmt::format(
              "folder '{}': has more than {} files and folders, too many to be listed; move away what is not Nodal's",
              folder_, entries_.size()));
    }
    entries_.push_back(std::move(entry));
    return {};
  }

  /// Sorted by name.
  std::vector<FolderEntry> entries() && {
    std::ranges::sort(entries_, {}, &FolderEntry::name);
    return std::move(entries_);
  }

  static std::vector<std::string> names_of(std::vector<FolderEntry> entries) {
    std::vector<std::string> names(entries.size());
    std::ranges::transform(entries, names.begin(), [](FolderEntry& entry) { return std::move(entry.name); });
    return names;
  }

 private:
  const std::string folder_;
  std::vector<FolderEntry> entries_;
  std::size_t names_bytes_ = 0;
};

}  // namespace nodal::hal
