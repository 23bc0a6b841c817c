// When and where a picture was taken, as results keep it.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "protocol/base/decoded_image.h"

namespace nodal::media {

struct PlaceAndTime {
  std::vector<std::uint8_t>
      exif{};  ///< a new block (FileMetadata::exif) with these tags alone; empty: nothing is known
  /// The same as properties of XMP, name ("exif:GPSLatitude") and value.
  std::vector<std::pair<std::string, std::string>> properties{};
};

/// Dates, camera, and the GPS tags of an Exif block. `direction`: also the compass direction that the camera looked in,
/// which is not that of a picture made of several. Tags that are broken are left out.
///
/// Threading: thread-safe.
PlaceAndTime place_and_time(const FileMetadata& metadata, bool direction);

}  // namespace nodal::media
