// Says in an MP4 or MOV file that its pictures are spheres: Spherical Video V1 (a uuid box in the video track) and V2
// (st3d and sv3d in its sample entry), by the RFCs of github.com/google/spatial-media. ffmpeg writes V2 alone.
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

/// The contents of a moov box, with the metadata of an equirectangular sphere in its first video track, and chunk
/// offsets changed for `moved`. Boxes of 64-bit offsets (co64) are made where an offset needs them.
/// Errors: kBadFormat, kUnsupported.
Result<std::vector<std::uint8_t>> spherical_moov(std::span<const std::uint8_t> moov, std::span<const MovedRange> moved);

/// Copies the file `from` to `to`, which is not there yet, with that metadata and with its index in front, so that
/// players on the web can begin at once. With `spherical` false only the index is moved.
/// Errors: kBadFormat, kTooLarge, kDiskFull, kIo.
Status write_spherical_mp4(const std::string& from, const std::string& to, bool spherical);

}  // namespace nodal::film
