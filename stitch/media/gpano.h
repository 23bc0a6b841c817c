// Google's Photo Sphere metadata: marks a picture as one of the sphere, for viewers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::media {

/// The XMP packet of Google's Photo Sphere metadata (ns.google.com/photos/1.0/panorama) for a whole sphere,
/// 360 x 180 degrees, middle column forward.
std::string gpano_packet(int width, int height);

/// The part of the sphere that a picture shows, px of the size that it had when this was written. All 0: not said.
struct SphereArea {
  std::int64_t full_width = 0, full_height = 0;  ///< of the whole sphere
  std::int64_t left = 0, top = 0;
  std::int64_t width = 0, height = 0;  ///< of the part
};

/// What a picture's file says; nothing unless it says that the picture is equirectangular. As viewers do it: by the packet's text
/// anywhere in the file.
std::optional<SphereArea> read_gpano(std::string_view file);

/// The whole sphere, black where `part` does not show it; `part` itself if it is whole, or if its area is not said. Errors:
/// kBadFormat for an area that is not a part of a sphere; kTooLarge.
Result<DecodedImage> whole_sphere(DecodedImage part, const SphereArea& area);

}  // namespace nodal::media
