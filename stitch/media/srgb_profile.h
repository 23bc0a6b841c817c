// Whether a colour profile is that of sRGB, for programs without colour management. Internal to stitch/media.
#pragma once

#include <cstdint>
#include <span>

namespace nodal::media {

/// Whether an ICC profile means sRGB to within a level of 8 bits: the profile of a display with sRGB's primaries and
/// curve, or one for grey pictures with sRGB's curve (ICC.1:2010). False for a profile that is broken or has tables of
/// colours.
bool is_srgb_profile(std::span<const std::uint8_t> icc);

}  // namespace nodal::media
