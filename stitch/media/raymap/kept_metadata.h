// What a result's file says of the pictures that it was made of.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "stitch/media/gpano.h"

namespace nodal::media {

struct KeptMetadata {
  XmpProperties properties{};
  std::vector<std::uint8_t> exif{};  ///< FileMetadata::exif
};

/// How much of a picture's metadata is true of the result.
enum class Keep : std::uint8_t {
  kAll,           ///< the same sphere: pose, compass direction, first view, date, place
  kTurned,        ///< the same sphere, turned: all but the compass direction in Exif
  kPlaceAndTime,  ///< another look at it, or one of several pictures of it: date and place
};

/// Of the picture's XMP and Exif; where both say the same, the XMP counts.
KeptMetadata kept_metadata(const FileMetadata& metadata, Keep keep);

}  // namespace nodal::media
