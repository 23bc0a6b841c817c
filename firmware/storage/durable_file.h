#pragma once

#include <string>
#include <string_view>

#include "hal/disk.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// Writes a file of `folder` so that after a crash in any operation either what was there before is there, or this,
/// whole: beside it as `file.tmp`, fsync, rename, fsync of the folder. `file` names the folder too; "" is the root.
/// Errors: the disk's; what was there stays.
Status write_durably(hal::DiskPort& disk, const std::string& folder, const std::string& file, std::string_view text);

inline constexpr std::string_view kTemporarySuffix = ".tmp";

}  // namespace nodal::firmware
