// What a TIFF's tags say of its colours beside a profile. Internal to stitch/media/tiff.
#pragma once

#include <tiffio.h>

#include "protocol/base/decoded_image.h"

namespace nodal::media {

/// Sets curve, primaries and `unread` by the tags TransferFunction, WhitePoint and PrimaryChromaticities (TIFF 6.0,
/// section 20).
void read_colorimetry(TIFF* tiff, SampleMeaning& meaning);

}  // namespace nodal::media
