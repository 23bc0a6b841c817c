// Metadata that marks a picture as a picture of the whole sphere, for viewers.
#pragma once

#include <string>

namespace nodal::media {

/// The XMP packet of Google's Photo Sphere metadata (ns.google.com/photos/1.0/panorama) for a whole sphere,
/// 360 x 180 degrees, middle column forward.
std::string gpano_packet(int width, int height);

}  // namespace nodal::media
