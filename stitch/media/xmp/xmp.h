// XMP packets (ISO 16684-1), as far as results keep what they say.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include "stitch/media/gpano.h"

namespace nodal::media {

/// Of a packet; the rest of a longer one is not read.
inline constexpr std::size_t kMaxXmpBytes = std::size_t{1} << 20;
/// Elements that are nested deeper are not read.
inline constexpr int kMaxXmpDepth = 32;

struct XmpWords {
  std::optional<SphereArea> area;  ///< nothing unless the picture is said to be equirectangular
  XmpProperties kept;              ///< as gpano_packet() writes them; each name once
};

/// What is not understood says nothing: of broken XML, what stands before the fault counts.
///
/// Threading: thread-safe.
XmpWords parse_xmp(std::string_view packet);

}  // namespace nodal::media
