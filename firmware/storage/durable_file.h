#pragma once

#include <string>
#include <string_view>

#include "hal/disk.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// Writes a file atomically: writes `file.tmp`, fsync, rename, fsync of the folder. After a crash at any point the file
/// has either its old or its new contents, complete. `file` includes the path of `folder`; a `folder` of "" is the
/// root.
/// Errors: the disk's; the old contents stay.
Status write_durably(hal::DiskPort& disk, const std::string& folder, const std::string& file, std::string_view text);
/// The same for a file that must not be there yet. Errors: also kExists; what is there stays.
Status create_durably(hal::DiskPort& disk, const std::string& folder, const std::string& file, std::string_view text);

inline constexpr std::string_view kTemporarySuffix = ".tmp";

}  // namespace nodal::firmware
