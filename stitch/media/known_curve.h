// Curves and primaries that are given as numbers, by the names that SampleMeaning has for them. Internal to
// stitch/media.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/base/decoded_image.h"

namespace nodal::media {

/// `table`: the light, of 65535, of the samples 0, 1, 2 .. to the largest. kSrgb or kGamma if the table is that curve
/// to within a level of 8 bits; nothing for any other.
std::optional<SampleMeaning> known_curve(std::span<const std::uint16_t> table);

/// Whether x, y of white, red, green and blue are those of sRGB, as they are rounded in files.
bool is_srgb_primaries(const std::array<double, 8>& xy);

}  // namespace nodal::media
