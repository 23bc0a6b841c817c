// ICC profiles, by Little CMS. Internal to stitch/media/colour.
#pragma once

#include <lcms2.h>

#include <memory>

#include "protocol/base/decoded_image.h"

namespace nodal::media {

struct CloseProfile {
  void operator()(void* profile) const { cmsCloseProfile(profile); }
};
using Profile = std::unique_ptr<void, CloseProfile>;

/// Of pictures whose meaning is this; null if its ICC profile, or its numbers, are no profile.
Profile profile_of(const SampleMeaning& meaning, bool grey);

/// sRGB's primaries and white with sRGB's curve, or none for `linear`; for `grey`, white and curve alone.
Profile plain_profile(bool linear, bool grey);

/// Whether the profile's numbers are proportional to light.
bool is_linear_profile(cmsHPROFILE profile);

}  // namespace nodal::media
