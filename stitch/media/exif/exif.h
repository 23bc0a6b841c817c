// What a camera says about its lens and its attitude in a picture file (Exif 2.32).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/base/decoded_image.h"

namespace nodal::media {

/// Exif is in the first segments of a JPEG, each of at most 64 KiB.
inline constexpr std::size_t kExifBytes = 256 * 1024;
/// The diagonal of a frame of 35 mm film, to which FocalLengthIn35mmFilm refers.
inline constexpr double kFilmDiagonalMm = 43.26661530556787;

struct Exif {
  /// The focal length that shows as much on 35 mm film, mm, 1 .. 2000: FocalLengthIn35mmFilm, or else computed from
  /// FocalLength and FocalPlaneXResolution. Nothing if the picture does not say it.
  std::optional<double> focal_35mm;
  int orientation = 1;  ///< 1 .. 8; 1: the rows of the file are those of the scene
  /// Numbers are Adobe RGB's, as cameras say it without a profile: Interoperability index R03 (DCF 2.0, 3.3.3),
  /// or ColorSpace 2.
  bool adobe_rgb = false;
};

/// The direction in a file's pixels, x right and y down, that is up for people who look at a picture with this Exif
/// orientation.
std::array<double, 2> up_of(int orientation);

/// Whether the orientation is left over from before the picture was turned: a quarter turn of a picture that is higher
/// than wide. Sensors are wider than high, so cameras write none; programs that turn pixels forget the tag.
bool is_outdated(int orientation, int width, int height);

/// The meaning of numbers in Adobe RGB (1998).
SampleMeaning adobe_rgb();

/// `start`: the first bytes of a JPEG, kExifBytes of them if there are as many. Bytes that are not understood say
/// nothing.
///
/// Threading: thread-safe.
Exif parse_exif(std::span<const std::uint8_t> start);

/// The same for a block of metadata.
Exif exif_of(const FileMetadata& metadata);

}  // namespace nodal::media
