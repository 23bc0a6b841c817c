// The bytes of a picture's file: opened once, each byte read once.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/files/open_file.h"

namespace nodal::media {

/// An open file that is read from its beginning as far as its readers ask. Readers of headers and of pixels share the
/// bytes.
///
/// Threading: thread-bound.
/// Ownership: owns the descriptor, and the bytes that were read and not taken.
/// Errors: each names the picture.
class PictureBytes {
 public:
  /// Reads nothing yet. Errors: kNotFound, kIo; kBadFormat for a folder or a device.
  static Result<PictureBytes> open(const std::filesystem::path& file);

  const std::string& name() const { return name_; }
  /// The file's length when it was opened, bytes.
  std::uint64_t size() const { return size_; }
  /// For a reader that seeks, which must not rely on its position.
  int descriptor() const;

  /// The first `count` bytes of the file, or all of them if it is shorter; valid until the next call. Errors: kIo.
  Result<std::span<const std::uint8_t>> first(std::size_t count);
  /// Moves out what first() has read, at least the bytes that it returned last; a later call reads again.
  std::vector<std::uint8_t> take();

 private:
  PictureBytes(std::string name, FilePtr file, std::uint64_t size);

  std::string name_;
  FilePtr file_;
  std::uint64_t size_;
  std::vector<std::uint8_t> bytes_;  ///< the file's first ones
};

}  // namespace nodal::media
