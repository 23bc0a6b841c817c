// What SimDisk stores.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hal/sim/disk.h"

namespace nodal::hal::sim {

/// The object that a name refers to: a folder, or a file's bytes, of which the first `synced` are durable.
struct SimDisk::Inode {
  bool folder = false;
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

}  // namespace nodal::hal::sim
