// Pictures as JPEG files.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"

namespace nodal::media {

/// The format of a JpegWriter's pictures, and the settings of all its files.
struct JpegSpec {
  PixelFormat format = PixelFormat::kRgb24;  ///< one that JpegWriter::writes()
  int width = 0;
  int height = 0;
  int quality = 90;           ///< 1 .. 100
  std::string_view xmp = {};  ///< an XMP packet, written into an APP1 segment; empty: none. Copied
  /// The picture is a field of an interlaced frame: an APP0 segment AVI1 says so, as in AVI files (OpenDML AVI, 1.02).
  std::optional<FieldParity> field{};
  std::span<const std::uint8_t> exif{};  ///< FileMetadata::exif, written into an APP1 segment; empty: none. Copied
};

/// Compresses pictures of one size, many times, with TurboJPEG. I420 and NV12 are coded as 4:2:0; I422, YUYV and UYVY
/// as 4:2:2; YUV411 as 4:1:1, RGB as 4:4:4.
///
/// Threading: thread-bound.
/// Ownership: keeps a scratch buffer for the largest JPEG that such a picture can give.
/// Errors: kInternal with TurboJPEG's message.
class JpegWriter {
 public:
  static bool writes(PixelFormat format);

  explicit JpegWriter(const JpegSpec& spec);
  ~JpegWriter();
  JpegWriter(const JpegWriter&) = delete;
  JpegWriter& operator=(const JpegWriter&) = delete;

  /// Of the next files.
  void set_quality(int quality) { quality_ = quality; }
  /// Writes a whole file with `comment` (at most 65533 bytes; empty: none) in its comment segment. Replaces the content
  /// of `into` but keeps its capacity, so that nothing is allocated once it has held the largest file.
  Status write(const ImageView& picture, std::string_view comment, std::vector<std::uint8_t>& into);

 private:
  /// Interleaved components copied to separate planes; other pictures unchanged.
  ImageView with_planes(const ImageView& picture);
  Result<std::size_t> compress(const ImageView& picture);

  const PixelFormat format_;
  const int width_, height_;
  int quality_;
  const std::optional<FieldParity> field_;
  void* handle_;
  std::vector<std::uint8_t> metadata_;       ///< the whole APP1 segments of Exif and XMP, or empty
  std::vector<std::uint8_t> planes_;         ///< planar copy of NV12, YUYV, UYVY and YUV411 pictures
  std::unique_ptr<std::uint8_t[]> scratch_;  ///< not cleared, so pages that no JPEG reaches stay unmapped
  std::size_t scratch_bytes_ = 0;
};

}  // namespace nodal::media
