// A file from a folder that may come from anywhere.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::media {

/// A regular file, open for reading: not a device, and not reached through a symbolic link.
///
/// Threading: thread-bound.
/// Ownership: owns the descriptor.
/// Errors: kNotFound if it is not there or not a plain file; kIo; kTruncated. Each names the file.
class PlainFile {
 public:
  static Result<PlainFile> open(const std::filesystem::path& path);
  ~PlainFile();
  PlainFile(PlainFile&& other) noexcept;
  PlainFile& operator=(PlainFile&& other) noexcept;

  const std::string& name() const { return name_; }
  /// When it was opened.
  std::uint64_t size() const { return size_; }
  /// Fills `bytes` from there on. kTruncated if the file ends before.
  Status read(std::uint64_t at, std::span<std::uint8_t> bytes) const;

 private:
  PlainFile(std::string name, int fd, std::uint64_t size) : name_(std::move(name)), fd_(fd), size_(size) {}

  std::string name_;
  int fd_ = -1;
  std::uint64_t size_ = 0;
};

/// All of a file. Errors: those of PlainFile; kTooLarge.
Result<std::vector<std::uint8_t>> read_plain_file(const std::filesystem::path& path, std::uint64_t limit);

}  // namespace nodal::media
