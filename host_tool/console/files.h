// Files of the host, replaced atomically: a reader sees the old one or the whole new one.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host {

/// Errors: kNotFound, kTooLarge (over `limit`), kIo.
Result<std::string> read_file(const std::string& path, std::size_t limit);

/// kNow: on the disk when write_file() returns (fsync). kLater: when the system gets to it.
enum class Durability { kNow, kLater };

/// Writes beside `path`, then renames over it. Nothing of it stays when that fails. Its mode is 0666 without the umask.
/// Errors: kDiskFull, kNotFound (the folder), kIo; each names the file.
Status write_file(const std::string& path, std::span<const std::uint8_t> bytes,
                  Durability durability = Durability::kNow);
Status write_file(const std::string& path, std::string_view text);

/// `pattern` with its %d or %06d replaced by `number`, and %% by %. At most one number.
/// Errors: kBadValue for anything else behind a %.
Result<std::string> numbered_name(const std::string& pattern, std::uint64_t number);
/// Whether numbered_name() gives every number a name of its own.
bool has_number(const std::string& pattern);

}  // namespace nodal::host
