// What SimDisk stores.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hal/file_name.h"
#include "hal/sim/disk.h"

namespace nodal::hal::sim {

/// The object that a name refers to: a folder, a symbolic link, or a file's bytes, of which the first `synced` are
/// durable.
struct SimDisk::Inode {
  bool folder = false;
  bool link = false;
  std::uint64_t version = 0;  ///< FolderEntry::version
  std::vector<std::uint8_t> bytes;
  std::size_t synced = 0;
  /// Since the last sync: what replaced sectors had before, and the durable bytes from before the file was shortened.
  std::vector<std::pair<std::size_t, std::vector<std::uint8_t>>> replaced{};
  std::optional<std::vector<std::uint8_t>> before_cut{};
  bool lost = false;  ///< a sync failed: later ones do not make the earlier bytes durable
};

inline std::string parent_of(const std::string& name) {
  const std::size_t slash = name.rfind('/');
  return slash == std::string::npos ? "" : name.substr(0, slash);
}

inline bool inside(const std::string& name, const std::string& folder) {
  return name.size() > folder.size() && name.compare(0, folder.size(), folder) == 0 && name[folder.size()] == '/';
}

// Errors.
inline Error bad_name(const std::string& name) {
  return {Errc::kBadValue, "file '" + name + "': a name is parts with '/' between, never '..', '.' or empty ones"};
}
inline Error not_there(const std::string& name) { return {Errc::kNotFound, "file '" + name + "': is not there"}; }
inline Error disk_gone(const std::string& name) { return {Errc::kDeviceGone, "file '" + name + "': the disk is gone"}; }
inline Error no_power(const std::string& name) { return {Errc::kIo, "file '" + name + "': the disk lost its power"}; }
inline Error name_taken(const std::string& name) {
  return {Errc::kExists, "file '" + name + "': making it failed: there is something of that name"};
}

}  // namespace nodal::hal::sim
