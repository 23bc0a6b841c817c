// Coding-independent code points, by which films and PNGs name their colours (ITU-T H.273). Internal to stitch/media.
#pragma once

#include <cstdint>
#include <span>

#include "protocol/base/decoded_image.h"

namespace nodal::media {

/// Sets curve and primaries, or `unread`, by four code points: primaries, transfer, matrix, and whether the range is
/// full. A profile no longer counts. BT.709's and BT.601's curves, as FFmpeg writes them into pictures of films, stay
/// unsaid: viewers show such numbers as sRGB's.
void set_code_points(std::span<const std::uint8_t, 4> points, SampleMeaning& meaning);

}  // namespace nodal::media
