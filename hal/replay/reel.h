// The pictures of one head, in order.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/replay/picture_reader.h"

namespace nodal::hal::replay {

/// Threading: thread-bound.
/// Ownership: owns the decoded pictures that it keeps; a picture lives as long as it has a holder.
/// Errors: see open().
class Reel {
 public:
  using Picture = std::shared_ptr<const DecodedImage>;

  /// `where` is a file, a folder (its JPEGs and PNGs) or a glob(7) pattern.
  /// Errors: kNoSuchDevice if there is no picture; kBadValue if sizes differ; those of a broken picture.
  static Result<Reel> open(const std::filesystem::path& where, std::optional<PixelFormat> as, std::uint64_t keep_bytes,
                           const PictureReader& reader);

  /// Whether there is a picture to open.
  static bool present(const std::filesystem::path& where);

  std::size_t size() const { return files_.size(); }
  PixelFormat format() const { return format_; }
  int width() const { return width_; }
  int height() const { return height_; }
  /// Picture i, or null if it cannot be decoded or its size has changed.
  Picture picture(std::size_t i);

 private:
  PictureReader reader_;
  std::vector<std::filesystem::path> files_;
  std::vector<Picture> kept_;
  std::size_t may_keep_ = 0;  ///< limit in pictures
  std::size_t keeps_ = 0;
  PixelFormat format_ = PixelFormat::kRgb24;
  int width_ = 0;
  int height_ = 0;
};

}  // namespace nodal::hal::replay
