// Pictures as files of any format that nodal reads: JPEG, PNG, TIFF, HEIF, WebP.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host_tool/input/picture_split.h"
#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::media {
class PictureBytes;
}

namespace nodal::host {

/// A picture in sRGB's numbers (media::in_srgb): GREY, I420 or RGB24 as its file suits; `as`: GREY or RGB24 instead.
/// Errors: those of the readers and of in_srgb(); each names the file.
Result<DecodedImage> read_picture(const std::string& file, std::optional<PixelFormat> as = std::nullopt);
/// The same for the bytes of a JPEG or PNG, such as a picture of the film `name`.
Result<DecodedImage> picture_of(std::span<const std::uint8_t> bytes, const std::string& name);

/// The same with all 16 bits, as GREY16 or RGB48, if the file has them, and otherwise as GREY or RGB24. Numbers of 16
/// bits that are proportional to light stay so; meaning.is_linear() says it.
Result<DecodedImage> read_deep_picture(const std::string& file);

/// How opaque a file's pixels are, GREY; nothing if it has no alpha channel, or if all of them are opaque.
/// Errors: those of the readers.
Result<std::optional<DecodedImage>> read_opacity(const std::string& file);
Result<std::optional<DecodedImage>> read_opacity(media::PictureBytes& file);

/// Size and natural format of an open file, without decoding it.
Result<ImageHeader> read_picture_header(media::PictureBytes& file);

/// The same picture in another format of 8 bits: media::convert_image() with meaning and metadata.
DecodedImage in_format(DecodedImage picture, PixelFormat format);

/// The heads whose response is linear.
std::vector<bool> linear_heads(const Calibration& calibration);

/// One head's picture: a file that is opened and decoded at most once while its pixels are kept, or pixels that a
/// running rig sent.
///
/// Threading: thread-bound; several may be decoded at a time.
/// Ownership: owns the file until it is decoded, and the pixels.
class HeadPicture {
 public:
  /// `opened`: the file, if something of it was read already.
  explicit HeadPicture(std::string file, std::shared_ptr<media::PictureBytes> opened = nullptr);
  /// One of several pictures in a file.
  HeadPicture(std::string file, PictureSplit split, std::size_t part);
  explicit HeadPicture(DecodedImage pixels);

  /// Empty if it is from a running rig.
  const std::string& file() const { return file_; }
  /// The part of a picture of the whole file that belongs to this head.
  DecodedImage own_part(const DecodedImage& whole) const;
  /// Decodes the file in its natural format: GREY, I420 or RGB24 in sRGB's numbers, except that numbers which the file
  /// calls proportional to light stay so with `of_linear_head`. Nothing is done if the pixels are there.
  /// Errors: those of read_picture().
  Status decode(bool of_linear_head);
  /// Size and natural format; a file stays open until decode().
  /// Errors: those of read_picture_header().
  Result<ImageHeader> header();
  /// How opaque the whole file's pixels are, as read_opacity() says it. The file stays open until decode(); after it,
  /// only a file that may have an alpha channel is opened again.
  /// Errors: those of read_opacity().
  Result<std::optional<DecodedImage>> opacity();
  /// After decode().
  const DecodedImage& pixels() const { return *pixels_; }
  /// What the camera says of its lens and attitude (media::Exif). After decode().
  std::optional<double> focal_35mm() const { return focal_35mm_; }
  int orientation() const { return orientation_; }
  /// Whether the file calls its numbers proportional to light. After decode().
  bool says_linear() const { return says_linear_; }
  /// Moves the pixels out.
  DecodedImage take();
  /// Frees the pixels of a file; decode() reads it again.
  void release();

 private:
  Result<std::shared_ptr<media::PictureBytes>> open() const;

  std::string file_;
  PictureSplit split_;
  std::size_t part_ = 0;
  std::shared_ptr<media::PictureBytes> opened_;
  std::optional<DecodedImage> pixels_;
  std::optional<double> focal_35mm_;
  int orientation_ = 1;
  bool says_linear_ = false;     ///< the file's numbers are proportional to light
  bool of_linear_head_ = false;  ///< how it was decoded
  bool opaque_ = false;          ///< the file was decoded, and its format or header says that it has no alpha channel
};

/// Decodes a set's pictures on all cores. `begin(n)` is called on the caller's thread before pictures n and later are
/// decoded. `of_linear_heads[n]`: as for HeadPicture::decode(); empty: none.
/// Errors: that of the first picture, in their order, that has one.
Status decode_all(
    std::vector<HeadPicture>& pictures, const std::vector<bool>& of_linear_heads = {},
    const std::function<void(std::size_t n)>& begin = [](std::size_t) {});

}  // namespace nodal::host
