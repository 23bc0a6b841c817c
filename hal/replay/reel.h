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
/// Ownership: owns what it keeps decoded; a picture lives as long as somebody holds it.
/// Errors: see open().
class Reel {
 public:
  using Picture = std::shared_ptr<const DecodedImage>;

  /// `where` is a file, a folder (its JPEGs and PNGs) or a glob(7) pattern.
  /// Errors: kNoSuchDevice when no picture is there; kBadValue when sizes differ; those of a broken picture.
  static Result<Reel> open(const std::filesystem::path& where, std::optional<PixelFormat> as, std::uint64_t keep_bytes,
                           const PictureReader& reader);

  /// Whether there is anything to open.
  static bool present(const std::filesystem::path& where);

  std::size_t size() const { return files_.size(); }
  PixelFormat format() const { return format_; }
  int width() const { return width_; }
  int height() const { return height_; }
  /// Picture i, or null when it cannot be decoded or has changed its size.
  Picture picture(std::size_t i);

 private:
  PictureReader reader_;
  std::vector<std::filesystem::path> files_;
  std::vector<Picture> kept_;
  std::size_t may_keep_ = 0;  ///< pictures
  std::size_t keeps_ = 0;
  PixelFormat format_ = PixelFormat::kRgb24;
  int width_ = 0;
  int height_ = 0;
};

}  // namespace nodal::hal::replay
