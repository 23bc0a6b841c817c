// Pictures in sRGB's numbers, whatever their files say that their numbers stand for.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"

namespace nodal::media {

/// Whether in_srgb() would change the samples of a picture of this meaning, if they have 8 bits.
bool needs_conversion(const SampleMeaning& meaning);

/// Converts the samples to sRGB by the picture's ICC profile, or its curve and primaries (Little CMS, relative
/// colorimetric with black point compensation). Pictures of 16 bits whose numbers are proportional to light stay so,
/// with the primaries of sRGB. Afterwards the meaning is sRGB's or linear; what was unsaid stays unsaid. `picture`:
/// GREY, RGB24, GREY16, RGB48.
///
/// Threading: thread-safe.
/// Errors: kUnsupported, with the picture's name and what to do, for a profile that is broken or not for such pictures.
Status in_srgb(DecodedImage& picture, const std::string& name);

/// A picture of 16 bits in 8, and sRGB's numbers if it was linear.
DecodedImage shown_in_8_bits(const DecodedImage& deep);

/// The profile by which files that have no shorter word for it say that their numbers are linear. The same bytes
/// always.
std::vector<std::uint8_t> linear_profile(bool grey);

}  // namespace nodal::media
