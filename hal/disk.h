#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::hal {

using FileHandle = std::uint32_t;

/// A folder that survives power loss to the degree one asks for. Names are relative to it, with "/" between
/// parts, never "..". What is not synced may be gone, or half there, after a crash.
///
/// Threading: thread-bound to its stage.
/// Ownership: handles are closed by close() or with the port.
/// Errors: kNotFound, kExists, kDiskFull, kIo; each names the file. kWrongState for a handle that is not open.
class DiskPort {
 public:
  virtual ~DiskPort() = default;
  /// A new empty file to append to; an older one of that name is replaced.
  virtual Result<FileHandle> create(const std::string& name) = 0;
  /// An existing file to append to.
  virtual Result<FileHandle> open_append(const std::string& name) = 0;
  /// An existing file to read from any place. kIo for what is no file.
  virtual Result<FileHandle> open_read(const std::string& name) = 0;
  /// The file's bytes from `offset` on, and how many: less than `bytes` has only at the end of the file, 0 at its end and
  /// behind it. The file may grow or shrink between calls. kWrongState for a handle of create() or open_append().
  virtual Result<std::size_t> read_at(FileHandle file, std::uint64_t offset, std::span<std::uint8_t> bytes) = 0;
  /// All bytes or an error; after kDiskFull a part may be there. kWrongState for a handle of open_read().
  virtual Status write(FileHandle file, std::span<const std::uint8_t> bytes) = 0;
  virtual Status sync(FileHandle file) = 0;
  virtual void close(FileHandle file) = 0;

  virtual Result<std::vector<std::uint8_t>> read(const std::string& name, std::uint64_t limit_bytes) = 0;
  virtual Result<std::uint64_t> size(const std::string& name) = 0;
  /// Replaces `to` atomically.
  virtual Status rename(const std::string& from, const std::string& to) = 0;
  virtual Status remove(const std::string& name) = 0;
  virtual Status make_folder(const std::string& name) = 0;
  /// Makes creations, renames and removals in the folder last; "" is the root.
  virtual Status sync_folder(const std::string& name) = 0;
  /// Names directly inside, sorted.
  virtual Result<std::vector<std::string>> list(const std::string& folder) = 0;
  virtual Result<std::uint64_t> free_bytes() = 0;
};

}  // namespace nodal::hal
