// A picture decoded from a file: its header data and its pixels.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/image.h"

namespace nodal {

/// What the samples of a picture stand for, as its file says it. Samples are never multiplied by alpha.
struct SampleMeaning {
  enum class Curve : std::uint8_t { kUnsaid, kSrgb, kGamma };
  Curve curve = Curve::kUnsaid;  ///< kUnsaid: sRGB, or the response of the head that took the picture
  double gamma = 1;              ///< kGamma: sample = light^(1 / gamma); 1: proportional to light
  /// CIE x, y of white, red, green and blue; nothing: those of sRGB.
  std::optional<std::array<double, 8>> primaries{};
  std::vector<std::uint8_t> icc{};  ///< an ICC profile, which alone counts; empty: none
  std::string unread{};             ///< what the file says of its colours and no program here applies: "PQ (HDR)"
  bool alpha = false;               ///< the file has an alpha channel, which is left out
  /// Only for linear raymaps: the shutter, at 0 dB, with which the light of 65535 fills a sample. Empty: not known.
  std::optional<std::uint64_t> full_exposure_ns{};

  static SampleMeaning srgb() { return {.curve = Curve::kSrgb}; }
  static SampleMeaning linear() { return {.curve = Curve::kGamma}; }
  bool is_linear() const { return icc.empty() && curve == Curve::kGamma && gamma == 1; }
};

/// Metadata blocks as they stand in a file; empty: it has none.
struct FileMetadata {
  std::string xmp{};                 ///< an XMP packet
  std::vector<std::uint8_t> exif{};  ///< a TIFF structure, as behind "Exif\0\0" in a JPEG
};

/// A packed picture that owns its bytes; as MJPEG, those of a JPEG file.
struct DecodedImage {
  PixelFormat format = PixelFormat::kRgb24;
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> bytes;
  SampleMeaning meaning{};
  FileMetadata metadata{};

  ImageView view() const {
    if (format != PixelFormat::kMjpeg) return packed_image(format, width, height, bytes.data());
    ImageView jpeg{format, width, height, {}, bytes.size()};
    const int length = static_cast<int>(bytes.size());
    jpeg.planes[0] = {bytes.data(), length, 1, length, 1};
    return jpeg;
  }
};

/// The data of a file's header, read without decoding the picture.
struct ImageHeader {
  int width = 0;
  int height = 0;
  PixelFormat natural = PixelFormat::kRgb24;  ///< the format that decoding gives if none is requested
  /// RGB48 or GREY16 if the file has 16 bits a sample: the format in which decoding gives them all on request.
  std::optional<PixelFormat> deep = std::nullopt;
  /// What samples mean, for JPEGs and PNGs; in PNGs from what precedes the picture, where everything about colour is.
  SampleMeaning meaning{};
  FileMetadata metadata{};
};

}  // namespace nodal
