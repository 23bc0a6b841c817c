// Google's Photo Sphere metadata: marks a picture as one of the sphere, for viewers.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::media {

/// The namespaces of properties that are read and written, with the prefixes that are written.
struct XmpNamespace {
  std::string_view prefix, uri;
};
inline constexpr std::array kXmpNamespaces{XmpNamespace{"GPano", "http://ns.google.com/photos/1.0/panorama/"},
                                           XmpNamespace{"exif", "http://ns.adobe.com/exif/1.0/"},
                                           XmpNamespace{"xmp", "http://ns.adobe.com/xap/1.0/"},
                                           XmpNamespace{"photoshop", "http://ns.adobe.com/photoshop/1.0/"}};

struct XmpProperty {
  std::string name;  ///< with a prefix of kXmpNamespaces
  std::string value;
};
using XmpProperties = std::vector<XmpProperty>;

/// The part of the sphere that a picture shows, px of the size that it had when this was written. All 0: not said.
struct SphereArea {
  std::int64_t full_width = 0, full_height = 0;  ///< size of the whole sphere
  std::int64_t left = 0, top = 0;
  std::int64_t width = 0, height = 0;  ///< size of the part
};

/// The XMP packet of Google's Photo Sphere metadata (ns.google.com/photos/1.0/panorama) for a whole sphere,
/// 360 x 180 degrees, and `also` in it. Which way its middle column looks is said by `also` alone.
std::string gpano_packet(int width, int height, const XmpProperties& also = {});

/// The same for a part of the sphere: `area` with the size of the picture.
std::string gpano_packet(const SphereArea& area, const XmpProperties& also = {});

/// Whether a raymap of this layout is a sphere as viewers and players know it. They are told so by GPano metadata, or
/// by Matroska's projection.
inline bool is_whole_sphere(std::string_view layout) { return layout == "equirectangular"; }

/// The XMP packet of a raymap: gpano_packet() if it is a whole sphere for viewers, else xmp_packet().
std::string raymap_packet(std::string_view layout, int width, int height, const XmpProperties& also = {});

/// A packet of these properties, for other pictures; empty without any.
std::string xmp_packet(const XmpProperties& properties);

/// The whole sphere, black where `part` does not show it; `part` itself if it is whole, or if its area is not said. An
/// area that reaches over the right edge goes on at the left one. One that is too high or too low by no more than
/// rounding (kAreaSlack) is moved or cut. Errors: kBadFormat for an area that is not a part of a sphere; kTooLarge.
Result<DecodedImage> whole_sphere(DecodedImage part, const SphereArea& area);

/// Pixels by which an area may not fit on its sphere, or this part of the sphere, whichever is more.
inline constexpr std::int64_t kAreaSlack = 2;
inline constexpr std::int64_t kAreaSlackPart = 500;

}  // namespace nodal::media
