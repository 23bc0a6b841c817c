// What the segments of a JPEG say beside its pixels: colour profile, Exif, XMP.
#pragma once

#include <cstdint>
#include <span>

#include "protocol/base/decoded_image.h"

namespace nodal::media {

/// Sets meaning.icc (ICC.1:2010, B.4; a profile of which a part is missing is given without it), metadata.exif and
/// metadata.xmp. Stops at the first scan; bytes that are no segments end the search.
void read_segments(std::span<const std::uint8_t> jpeg, SampleMeaning& meaning, FileMetadata& metadata);

}  // namespace nodal::media
