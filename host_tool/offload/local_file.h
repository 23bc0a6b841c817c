// A file of a copy on the host's disk.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>

#include "protocol/base/result.h"

namespace nodal::host {

/// Threading: thread-bound.
/// Ownership: closes the file.
/// Errors: kDiskFull, kIo, kNotFound; each names the file.
class LocalFile {
 public:
  /// Opens or creates it, to read and write. Symbolic links, devices and files with other names, too (hard links), are
  /// refused, because the folder may come from anywhere.
  static Result<LocalFile> open_to_write(const std::filesystem::path& path);
  /// The same for reading a file that is there.
  static Result<LocalFile> open_to_read(const std::filesystem::path& path);
  LocalFile(LocalFile&& other) noexcept;
  LocalFile& operator=(LocalFile&&) = delete;
  ~LocalFile();

  Result<std::uint64_t> size() const;
  /// Reads `bytes` from `offset` on; less at the file's end. Returns their number.
  Result<std::size_t> read(std::uint64_t offset, std::span<std::uint8_t> bytes) const;
  /// What was written long before is not kept in memory.
  Status write(std::uint64_t offset, std::span<const std::uint8_t> bytes);
  Status truncate(std::uint64_t size);
  /// What is written is on the disk when it returns.
  Status sync();

 private:
  LocalFile(int fd, std::filesystem::path path);
  static Result<LocalFile> open(const std::filesystem::path& path, int flags);
  tl::unexpected<Error> failed(const char* what, int error) const;

  int fd_;
  std::filesystem::path path_;
  std::uint64_t let_go_ = 0;  ///< bytes before it are not kept in memory
};

/// A folder that one program at a time writes to.
///
/// Ownership: gives the folder up when it is destroyed.
/// Errors: kBusy if another program has it; kIo. A file system that knows no locks is used without.
class FolderLock {
 public:
  static Result<FolderLock> take(const std::filesystem::path& folder);
  FolderLock(FolderLock&& other) noexcept;
  FolderLock& operator=(FolderLock&&) = delete;
  ~FolderLock();

 private:
  explicit FolderLock(int fd) : fd_(fd) {}
  int fd_;
};

/// Makes renames and new files in the folder durable.
Status sync_folder(const std::filesystem::path& folder);
/// Gives a file its name. Errors: kExists if there is anything of that name, which then stays.
Status rename_new(const std::filesystem::path& from, const std::filesystem::path& to);
/// Bytes that this user may still write there.
Result<std::uint64_t> free_bytes(const std::filesystem::path& folder);
/// The length of a regular file; nothing if there is none of that name, or if it is something else.
std::optional<std::uint64_t> length_of_file(const std::filesystem::path& path);

}  // namespace nodal::host
