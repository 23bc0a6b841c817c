// A directory of a TIFF or of Exif, of which perhaps only the first bytes are there. Internal to stitch/media.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace nodal::media {

/// Refers to the bytes. What is broken, or behind their end, is as if it was not there.
class TiffDirectory {
 public:
  /// The first directory.
  explicit TiffDirectory(std::span<const std::uint8_t> file);

  /// The first value of a tag if it is a number that stands in the directory itself, of other values their first four
  /// bytes or their offset; 0 if it is cut off.
  std::optional<std::uint32_t> find(std::uint32_t tag) const;

  /// The directory at the offset that a tag gives.
  std::optional<TiffDirectory> linked(std::uint32_t tag) const;

  bool little_endian() const { return little_; }

 private:
  void open(std::size_t at);
  std::optional<std::uint32_t> number(std::size_t at, std::size_t bytes) const;

  std::span<const std::uint8_t> file_;
  bool little_ = true;
  std::size_t first_ = 0, count_ = 0;
};

}  // namespace nodal::media
