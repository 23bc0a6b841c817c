// A head's frame, as the head delivered it, as a picture.
#pragma once

#include <string>

#include "protocol/base/decoded_image.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// The frame decoded as the blend decodes it: MJPEG, a Bayer mosaic and colours in video range become what a
/// registration takes; other frames are copied.
/// Errors: kBadFormat, which names the head.
Result<DecodedImage> picture_of_frame(const ImageView& frame, const std::string& head);

}  // namespace nodal::host
