// Says in an MP4 or MOV file that its pictures are spheres: Spherical Video V1 (a uuid box in the video track) and V2
// (st3d and sv3d in its sample entry), and that its sound is ambisonic (SA3D), by the RFCs of
// github.com/google/spatial-media. ffmpeg writes V2 alone, and drops SA3D.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::film {

/// The largest index (moov) that is rewritten: about a day of film.
inline constexpr std::size_t kMaxMoovBytes = std::size_t{256} << 20;

/// Where a box of the file moves to.
struct MovedRange {
  std::uint64_t begin = 0, end = 0;  ///< bytes of the old file
  std::int64_t by = 0;
};

/// What a file says of itself.
struct Marks {
  bool spherical = false;  ///< its pictures are whole equirectangular spheres
  /// The content of an SA3D box: how the channels of its first sound track are ambisonic; empty: they are not.
  std::vector<std::uint8_t> ambisonic{};
};

/// The contents of a moov box, with these marks in its first video track and its first sound track, and chunk offsets
/// changed for `moved`. Boxes of 64-bit offsets (co64) are made where an offset needs them.
/// Errors: kBadFormat, kUnsupported.
Result<std::vector<std::uint8_t>> marked_moov(std::span<const std::uint8_t> moov, std::span<const MovedRange> moved,
                                              const Marks& marks);

/// The description of ambisonic sound that a file has for its first sound track, for Marks::ambisonic. Empty if it has
/// none, if it is damaged or names more than 64 channels, and for files that are not MP4 or MOV or cannot be read.
std::vector<std::uint8_t> ambisonic_of(const std::string& file);

/// Copies the file `from` to `to`, which is not there yet, with these marks and with its index in front, so that
/// players on the web can begin at once.
/// Errors: kBadFormat, kTooLarge, kDiskFull, kIo.
Status write_marked_mp4(const std::string& from, const std::string& to, const Marks& marks);

}  // namespace nodal::film
