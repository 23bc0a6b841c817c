// A file that grows on the host's disk, and is continued by a later process.
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
class PartFile {
 public:
  /// Opens or creates it. Symbolic links and devices are refused.
  static Result<PartFile> open(const std::filesystem::path& path);
  PartFile(PartFile&& other) noexcept;
  PartFile& operator=(PartFile&&) = delete;
  ~PartFile();

  Result<std::uint64_t> size() const;
  /// Reads `bytes` from `offset` on; less at the file's end. Returns their number.
  Result<std::size_t> read(std::uint64_t offset, std::span<std::uint8_t> bytes) const;
  Status write(std::uint64_t offset, std::span<const std::uint8_t> bytes);
  Status truncate(std::uint64_t size);
  /// What is written is on the disk when it returns.
  Status sync();

 private:
  PartFile(int fd, std::filesystem::path path);
  tl::unexpected<Error> failed(const char* what, int error) const;

  int fd_;
  std::filesystem::path path_;
};

/// Makes renames and new files in the folder durable.
Status sync_folder(const std::filesystem::path& folder);
/// Replaces `to` atomically.
Status rename_file(const std::filesystem::path& from, const std::filesystem::path& to);
/// Bytes that this user may still write there.
Result<std::uint64_t> free_bytes(const std::filesystem::path& folder);
/// The length of a regular file; nothing if there is none of that name, or if it is something else.
std::optional<std::uint64_t> length_of_file(const std::filesystem::path& path);

}  // namespace nodal::host
