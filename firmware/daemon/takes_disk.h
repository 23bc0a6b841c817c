// What the takes' stage needs of the board.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "hal/disk.h"
#include "protocol/base/result.h"

namespace nodal::daemon {

/// The folder of the takes, once for each thread that uses it.
struct TakesDisk {
  std::unique_ptr<hal::DiskPort> to_write;
  std::unique_ptr<hal::DiskPort> to_read;
};

/// The folder of [takes], which is made if it is not there. With `mounted`, the disk may come later. Nothing of it
/// stays open. Errors: kBusy if another nodald uses it; the disk's.
Result<TakesDisk> open_takes_disk(const std::filesystem::path& folder, bool mounted);

/// The board's clock in nanoseconds since 1970; 0 before 2020: a board without a battery for its clock starts in the
/// past.
std::int64_t utc_ns();

}  // namespace nodal::daemon
