// Files of the host, replaced atomically: a reader sees either the old file or the complete new one.
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

/// kNow: on disk when write_file() returns (fsync). kLater: when the kernel writes it back.
enum class Durability { kNow, kLater };

/// Writes a temporary file beside `path`, then renames it to `path`; removes it if that fails. The mode is 0666 minus
/// the umask. Errors: kExists (console/overwriting.h) unless the file has these bytes; kDiskFull, kNotFound (the
/// folder), kIo; each names the file.
Status write_file(const std::string& path, std::span<const std::uint8_t> bytes,
                  Durability durability = Durability::kNow);
Status write_file(const std::string& path, std::string_view text);

/// `pattern` with %d or %06d replaced by `number`, and %% by %; at most one number.
/// Errors: kBadValue for any other character after a %.
Result<std::string> numbered_name(const std::string& pattern, std::uint64_t number);
/// Whether numbered_name() gives a different name for every number.
bool has_number(const std::string& pattern);

}  // namespace nodal::host
